#include "client/files/camera_yaml.h"

#include <algorithm>

#include "client/files/text_file.h"
#include "client/files/yaml_value.h"

namespace romap {
namespace {

absl::Status ReadOptionalNumber(const YAML::Node& root, const std::string& key, const std::string& path,
                                double* value) {
  if (!root[key]) return absl::OkStatus();
  ROMAP_ASSIGN_OR_RETURN(*value, YamlNumber(root, key, path));
  if (*value <= 0) return InvalidArgument("{}: '{}' is {}, should be positive", path, key, *value);
  return absl::OkStatus();
}

absl::Status ReadSide(const YAML::Node& root, const std::string& key, const std::string& path, int* side_px) {
  ROMAP_ASSIGN_OR_RETURN(const double number, YamlNumber(root, key, path));
  if (number < 1 || number > 1e6 || number != static_cast<int>(number)) {
    return InvalidArgument("{}: '{}' is {}, should be a whole number of pixels", path, key, number);
  }
  *side_px = static_cast<int>(number);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<CameraYaml> ReadCameraYaml(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const YAML::Node root, LoadYamlMap(path));
  CameraYaml result;
  CameraModel& camera = result.camera;
  ROMAP_RETURN_IF_ERROR(ReadSide(root, "width", path, &camera.width_px));
  ROMAP_RETURN_IF_ERROR(ReadSide(root, "height", path, &camera.height_px));
  ROMAP_ASSIGN_OR_RETURN(camera.fx_px, YamlNumber(root, "fx", path));
  ROMAP_ASSIGN_OR_RETURN(camera.fy_px, YamlNumber(root, "fy", path));
  ROMAP_ASSIGN_OR_RETURN(camera.cx_px, YamlNumber(root, "cx", path));
  ROMAP_ASSIGN_OR_RETURN(camera.cy_px, YamlNumber(root, "cy", path));
  if (root["distortion"]) {
    ROMAP_ASSIGN_OR_RETURN(const std::vector<double> k,
                           YamlNumbers(root, "distortion", camera.distortion.size(), path));
    std::copy(k.begin(), k.end(), camera.distortion.begin());
  }
  ROMAP_RETURN_IF_ERROR(ReadOptionalNumber(root, "fps", path, &result.fps));
  ROMAP_RETURN_IF_ERROR(ReadOptionalNumber(root, "depth_scale", path, &result.depth_scale));
  if (absl::Status status = ValidateCameraModel(camera); !status.ok()) {
    return InvalidArgument("{}: {}", path, Message(status));
  }
  return result;
}

absl::Status WriteCameraYaml(const std::string& path, const CameraYaml& value) {
  const CameraModel& camera = value.camera;
  std::string text = fmt::format(
      "# pinhole camera; the integer pixel (u, v) is the pixel centre\n"
      "width: {}\nheight: {}\nfx: {}\nfy: {}\ncx: {}\ncy: {}\ndistortion: [{}]  # k1 k2 p1 p2 k3\nfps: {}\n",
      camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px,
      fmt::join(camera.distortion, ", "), value.fps);
  if (value.depth_scale > 0) {
    text += fmt::format("depth_scale: {}  # z = value * depth_scale; z depth, not ray length\n", value.depth_scale);
  }
  return WriteFile(path, text);
}

}  // namespace romap
