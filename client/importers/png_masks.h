#pragma once

#include <functional>
#include <opencv2/core/types.hpp>
#include <set>
#include <string>
#include <vector>

#include "client/importers/mask_layers.h"

namespace romap::importers {

// One PNG file of an instance: every pixel that is not 0 belongs to it.
struct InstancePng {
  std::string path;
  std::string class_name;
};

// Loads the instances of one image as one label image. Errors as ReadLabels.
absl::StatusOr<EncodedMasks> LoadInstancePngs(const std::vector<InstancePng>& instances, cv::Size size_px);

// Loads a label image as it is, or resized. Labels above 0 that `instances` does not list have no class.
absl::StatusOr<EncodedMasks> LoadLabelImage(const std::string& path, const std::vector<Instance>& instances,
                                            cv::Size size_px);

// A folder of mask images. Which of these kinds it has follows from the names of the frames:
//   FRAME.png, FRAME.jpg.png   one label image per frame
//   FRAME_ID.png               one image per instance
//   FRAME/CLASS_ID.png         a folder per frame, with one image per instance
std::vector<NamedMasks> ReadPngMasks(const std::string& folder, const std::set<std::string>& frame_names,
                                     cv::Size size_px);

}  // namespace romap::importers
