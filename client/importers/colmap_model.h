#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"
#include "common/status.h"

namespace romap::importers {

struct ColmapImage {
  std::string name;
  int64_t camera_id = 0;
  SE3<World, Camera> T_world_camera;
};

// Cameras and images of a COLMAP model (colmap.github.io/format.html). Pixel centers are at integer coordinates here;
// in COLMAP's files they are at 0.5.
struct ColmapModel {
  std::map<int64_t, CameraModel> cameras;
  std::vector<ColmapImage> images;  // in the order of the file
};

// Reads cameras and images, .bin or .txt, of the folder. INVALID_ARGUMENT names the file, and the line or the byte: it
// is malformed or truncated, or a camera model cannot be represented (the message names those that can). Otherwise as
// ReadFile.
absl::StatusOr<ColmapModel> ReadColmapModel(const std::string& folder);

// Whether the folder has the files of a model.
bool HasColmapModel(const std::string& folder);

// The camera of COLMAP's model `model` ("OPENCV") with its parameters. INVALID_ARGUMENT names what is not supported.
absl::StatusOr<CameraModel> ColmapCamera(const std::string& model, uint64_t width_px, uint64_t height_px,
                                         const std::vector<double>& parameters, const std::string& where);

}  // namespace romap::importers
