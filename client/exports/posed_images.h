#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/files/mapped_frames.h"
#include "client/files/sequence.h"
#include "common/geometry.h"
#include "common/status.h"

namespace romap::exports {

// The files of a frame with a pose, relative to the folder of the export.
struct PosedImage {
  std::string image;
  std::string mask;  // label PNG, 0 = no instance; empty: none
  int64_t timestamp_ns = 0;
  SE3<World, Camera> T_world_camera;
};

// Writes the images as they are (with the distortion of the lens) to `folder`/images and the label images to
// `folder`/masks. A frame whose image cannot be read is left out. Errors as WriteFile.
absl::StatusOr<std::vector<PosedImage>> WritePosedImages(const std::string& folder, const files::Sequence& sequence,
                                                         const std::vector<files::PosedFrame>& frames);

}  // namespace romap::exports
