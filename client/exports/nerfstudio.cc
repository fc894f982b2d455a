#include "client/exports/nerfstudio.h"

#include <nlohmann/json.hpp>

#include "client/files/ply.h"
#include "client/files/text_file.h"

namespace romap::exports {
namespace {

nlohmann::ordered_json CameraJson(const CameraModel& camera) {
  const bool is_fisheye = camera.lens == LensModel::kFisheye;
  const auto& k = camera.distortion;
  nlohmann::ordered_json json = {{"camera_model", is_fisheye ? "OPENCV_FISHEYE" : "OPENCV"},
                                 {"w", camera.width_px},
                                 {"h", camera.height_px},
                                 {"fl_x", camera.fx_px},
                                 {"fl_y", camera.fy_px},
                                 {"cx", camera.cx_px + 0.5},
                                 {"cy", camera.cy_px + 0.5},
                                 {"k1", k[0]},
                                 {"k2", k[1]}};
  if (is_fisheye) {
    json.update({{"k3", k[2]}, {"k4", k[3]}});
  } else {
    json.update({{"p1", k[2]}, {"p2", k[3]}, {"k3", k[4]}});
  }
  return json;
}

// 4 x 4, row by row.
nlohmann::ordered_json MatrixJson(const SE3<World, Camera>& T_world_camera) {
  Eigen::Matrix3d R = T_world_camera.rotation().toRotationMatrix();
  R.col(1) *= -1;
  R.col(2) *= -1;
  const Eigen::Vector3d& t = T_world_camera.translation();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int row = 0; row < 3; ++row) rows.push_back({R(row, 0), R(row, 1), R(row, 2), t[row]});
  rows.push_back({0, 0, 0, 1});
  return rows;
}

// Relative to the first one, because the writer takes vertices in single precision. `points` must not be empty.
absl::Status WritePoints(const std::string& path, const std::vector<ColoredPoint>& points) {
  const Eigen::Vector3d& origin = points.front().p_world;
  Mesh cloud;
  for (const ColoredPoint& point : points) {
    cloud.vertices.push_back((point.p_world - origin).cast<float>());
    cloud.colors.push_back(point.color);
  }
  return files::WriteWorldPly(path, cloud, {1, Eigen::Quaterniond::Identity(), origin});
}

}  // namespace

absl::Status WriteNerfstudio(const std::string& folder, const CameraModel& camera,
                             const std::vector<PosedImage>& images, const std::vector<ColoredPoint>& points) {
  ROMAP_RETURN_IF_ERROR(files::MakeFolder(folder));
  nlohmann::ordered_json json = CameraJson(camera);
  if (!points.empty()) {
    json["ply_file_path"] = "points.ply";
    ROMAP_RETURN_IF_ERROR(WritePoints(folder + "/points.ply", points));
  }
  json["frames"] = nlohmann::ordered_json::array();
  for (const PosedImage& image : images) {
    nlohmann::ordered_json frame = {{"file_path", image.image}};
    if (!image.mask.empty()) frame["mask_path"] = image.mask;
    frame["transform_matrix"] = MatrixJson(image.T_world_camera);
    json["frames"].push_back(std::move(frame));
  }
  return files::WriteFile(folder + "/transforms.json", json.dump(1) + "\n");
}

}  // namespace romap::exports
