#pragma once

#include <string>
#include <vector>

#include "client/exports/colored_points.h"
#include "client/exports/posed_images.h"
#include "common/camera_model.h"
#include "common/status.h"

namespace romap::exports {

// Writes `folder`/transforms.json as nerfstudio reads it (docs.nerf.studio, "Data conventions"): camera to world with
// the axes of OpenGL (x right, y up, z backward), the corner of the image at (0, 0), and `folder`/points.ply, colored
// points to start with. `mask_path` names the label image: other tools train only where it is not 0. Errors as
// WriteFile.
absl::Status WriteNerfstudio(const std::string& folder, const CameraModel& camera,
                             const std::vector<PosedImage>& images, const std::vector<ColoredPoint>& points);

}  // namespace romap::exports
