#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/importers/recording_contents.h"
#include "common/camera_model.h"
#include "common/status.h"

namespace romap::importers {

// How the depth images of a layout become z depth that is registered to the color images.
struct DepthRules {
  std::vector<uint16_t> unknown = {};  // values besides 0 that mean "no depth"
  // The camera of the depth images. nullopt: they cover the field of view of the color images, at any resolution.
  std::optional<CameraModel> camera = std::nullopt;
  std::string confidence =
      {};                  // PNG file with the confidence of each pixel, of the size of the depth image; empty: none
  int min_confidence = 0;  // smaller values mean "no depth"
};

// Makes `path` the depth image of a frame; `color`: the camera of the color images.
void SetDepth(const std::string& path, const DepthRules& rules, const CameraModel& color, RecordedFrame* frame);

// The depth image with the rules applied, as PNG; unchanged if they change nothing. INVALID_ARGUMENT: not a PNG file of
// 16 bits, or the confidence has another size. Otherwise as ReadFile.
absl::StatusOr<std::string> LoadDepthImage(const std::string& path, const DepthRules& rules, const CameraModel& color);

}  // namespace romap::importers
