#pragma once

#include <absl/status/statusor.h>

#include <opencv2/core/types.hpp>
#include <vector>

#include "client/importers/mask_layers.h"
#include "common/label_png.h"
#include "tests/fuzz/fuzz_target.h"

namespace romap::fuzz {

// Loads all masks that were read for a camera of this size.
inline void LoadMasks(const absl::StatusOr<std::vector<importers::NamedMasks>>& masks, const cv::Size& size_px) {
  if (!masks.ok()) return;
  for (const importers::NamedMasks& image : *masks) {
    const auto encoded = image.load();
    if (!encoded.ok()) continue;
    const auto labels = DecodeLabelPng(encoded->label_png);
    Require(labels.ok() && labels->size() == size_px, "the labels have the size of the camera");
  }
}

}  // namespace romap::fuzz
