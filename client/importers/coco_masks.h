#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "client/importers/mask_layers.h"

namespace romap::importers {

// Reads the instances of a COCO file (cocodataset.org, "data format"): polygons, and run lengths with or without
// compression. INVALID_ARGUMENT names the annotation. Otherwise as ReadFile.
absl::StatusOr<std::vector<NamedMasks>> ReadCocoMasks(const std::string& path, cv::Size size_px);

// The run lengths of a compressed COCO mask: 5 bits per character from '0' on with a continuation bit, as differences
// to the run before the last from the fourth on. INVALID_ARGUMENT: another character, or the text ends within a number.
absl::StatusOr<std::vector<uint32_t>> DecodeCocoRuns(std::string_view text);

// The mask of run lengths by columns, which start with 0s. INVALID_ARGUMENT: they do not sum to the size.
absl::StatusOr<cv::Mat> MaskOfRuns(const std::vector<uint32_t>& runs, cv::Size size_px);

}  // namespace romap::importers
