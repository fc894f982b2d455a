#include "client/exports/colmap.h"

#include <fmt/format.h>

#include <filesystem>
#include <iterator>

#include "client/files/text_file.h"

namespace romap::exports {
namespace {

// The model and its parameters: focal lengths, principal point, distortion.
std::string CameraText(const CameraModel& camera) {
  const auto& k = camera.distortion;
  std::string model = "PINHOLE", distortion;
  if (camera.lens == LensModel::kFisheye) {
    model = "OPENCV_FISHEYE";
    distortion = fmt::format(" {} {} {} {}", k[0], k[1], k[2], k[3]);
  } else if (k[4] != 0) {
    model = "FULL_OPENCV";
    distortion = fmt::format(" {} {} {} {} {} 0 0 0", k[0], k[1], k[2], k[3], k[4]);
  } else if (camera.HasDistortion()) {
    model = "OPENCV";
    distortion = fmt::format(" {} {} {} {}", k[0], k[1], k[2], k[3]);
  }
  return fmt::format("1 {} {} {} {} {} {} {}{}\n", model, camera.width_px, camera.height_px, camera.fx_px, camera.fy_px,
                     camera.cx_px + 0.5, camera.cy_px + 0.5, distortion);
}

}  // namespace

absl::Status WriteColmap(const std::string& folder, const CameraModel& camera, const std::vector<PosedImage>& images,
                         const std::vector<ColoredPoint>& points) {
  const std::string model = folder + "/sparse/0";
  ROMAP_RETURN_IF_ERROR(files::MakeFolder(model));
  ROMAP_RETURN_IF_ERROR(
      files::WriteFile(model + "/cameras.txt", "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n" + CameraText(camera)));
  std::string text = "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n";
  for (size_t k = 0; k < images.size(); ++k) {
    const SE3<Camera, World> T_camera_world = images[k].T_world_camera.Inverse();
    const Eigen::Quaterniond& q = T_camera_world.rotation();
    const Eigen::Vector3d& t = T_camera_world.translation();
    fmt::format_to(std::back_inserter(text), "{} {} {} {} {} {} {} {} 1 {}\n\n", k + 1, q.w(), q.x(), q.y(), q.z(),
                   t.x(), t.y(), t.z(), std::filesystem::path(images[k].image).filename().string());
  }
  ROMAP_RETURN_IF_ERROR(files::WriteFile(model + "/images.txt", text));
  text = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  for (size_t k = 0; k < points.size(); ++k) {
    const Eigen::Vector3d& p = points[k].p_world;
    const Rgb8& color = points[k].color;
    fmt::format_to(std::back_inserter(text), "{} {} {} {} {} {} {} 0\n", k + 1, p.x(), p.y(), p.z(), color[0], color[1],
                   color[2]);
  }
  return files::WriteFile(model + "/points3D.txt", text);
}

}  // namespace romap::exports
