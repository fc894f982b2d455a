#pragma once

#include <string>
#include <vector>

#include "client/exports/colored_points.h"
#include "client/exports/posed_images.h"
#include "common/camera_model.h"
#include "common/status.h"

namespace romap::exports {

// Writes `folder`/sparse/0/{cameras,images,points3D}.txt, a COLMAP model (colmap.github.io/format.html): world to
// camera, quaternion w first, and the corner of the image at (0, 0). The images have no 2D points, and the points no
// tracks. The names of the images are relative to `folder`/images. Errors as WriteFile.
absl::Status WriteColmap(const std::string& folder, const CameraModel& camera, const std::vector<PosedImage>& images,
                         const std::vector<ColoredPoint>& points);

}  // namespace romap::exports
