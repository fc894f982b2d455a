#pragma once

#include <opencv2/core/types.hpp>
#include <string>
#include <vector>

#include "client/importers/mask_layers.h"

namespace romap::importers {

// Reads a folder of Ultralytics YOLO segmentation labels: one text file per image with lines of `class x y x y ...`,
// normalized by the size of the image, optionally with a confidence at the end. The names of the classes are those of
// data.yaml (`names`, a list or a map), or the lines of classes.txt, in the folder or one of the two folders above;
// without them, "class_0" and so on. INVALID_ARGUMENT names the file and the line. Otherwise as ReadFile.
absl::StatusOr<std::vector<NamedMasks>> ReadYoloMasks(const std::string& folder, cv::Size size_px);

}  // namespace romap::importers
