#include "client/files/camera_yaml.h"

#include <algorithm>
#include <iterator>

#include "client/files/text_file.h"
#include "client/files/yaml_value.h"

namespace romap::files {
namespace {

absl::Status ReadOptionalNumber(const YAML::Node& root, const std::string& key, const std::string& path,
                                double* value) {
  if (!root[key]) return absl::OkStatus();
  ROMAP_ASSIGN_OR_RETURN(*value, YamlNumber(root, key, path));
  if (*value <= 0) return InvalidArgument("{}: '{}' is {}; expected a positive number", path, key, *value);
  return absl::OkStatus();
}

// Reads an image side [px].
absl::Status ReadSide(const YAML::Node& root, const std::string& key, const std::string& path, int* side_px) {
  ROMAP_ASSIGN_OR_RETURN(const double number, YamlNumber(root, key, path));
  if (number < 1 || number > 1e6 || number != static_cast<int>(number)) {
    return InvalidArgument("{}: '{}' is {}; expected a positive integer [px]", path, key, number);
  }
  *side_px = static_cast<int>(number);
  return absl::OkStatus();
}

struct LensName {
  const char* name;
  LensModel lens;
  const char* coefficients;
};
constexpr LensName kLensNames[] = {{"radial-tangential", LensModel::kRadialTangential, "k1 k2 p1 p2 k3"},
                                   {"fisheye", LensModel::kFisheye, "k1 k2 k3 k4, equidistant"}};

const LensName& NameOf(LensModel lens) { return kLensNames[lens == LensModel::kFisheye ? 1 : 0]; }

absl::Status ReadLens(const YAML::Node& root, const std::string& path, CameraModel* camera) {
  const YAML::Node node = root["lens"];
  const std::string text = YamlText(root, "lens", node ? "" : kLensNames[0].name);
  const auto* known = std::find_if(std::begin(kLensNames), std::end(kLensNames),
                                   [&](const LensName& candidate) { return text == candidate.name; });
  if (known == std::end(kLensNames)) {
    return InvalidArgument("{}:{}: 'lens' is '{}'; expected {} or {}", path, node.Mark().line + 1, text,
                           kLensNames[0].name, kLensNames[1].name);
  }
  camera->lens = known->lens;
  if (!root["distortion"]) return absl::OkStatus();
  const auto count = static_cast<size_t>(CoefficientCount(camera->lens));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> k, YamlNumbers(root, "distortion", count, path));
  std::copy(k.begin(), k.end(), camera->distortion.begin());
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
  ROMAP_RETURN_IF_ERROR(ReadLens(root, path, &camera));
  if (root["readout_s"]) {
    ROMAP_ASSIGN_OR_RETURN(camera.readout_s, YamlNumber(root, "readout_s", path));
  }
  ROMAP_RETURN_IF_ERROR(ReadOptionalNumber(root, "fps", path, &result.fps));
  ROMAP_RETURN_IF_ERROR(ReadOptionalNumber(root, "depth_scale", path, &result.depth_scale));
  result.world_up = YamlText(root, "world_up", "");
  if (root["world_up"] && std::ranges::count(kWorldUps, result.world_up) == 0) {
    return InvalidArgument("{}:{}: 'world_up' is '{}'; expected {}", path, root["world_up"].Mark().line + 1,
                           result.world_up, fmt::join(kWorldUps, ", "));
  }
  if (absl::Status status = ValidateCameraModel(camera); !status.ok()) {
    return InvalidArgument("{}: {}", path, Message(status));
  }
  return result;
}

absl::Status WriteCameraYaml(const std::string& path, const CameraYaml& value) {
  const CameraModel& camera = value.camera;
  const LensName& lens = NameOf(camera.lens);
  std::string text = fmt::format(
      "# pixel centers are at integer coordinates\n"
      "width: {}\nheight: {}\nfx: {}\nfy: {}\ncx: {}\ncy: {}\nlens: {}\ndistortion: [{}]  # {}\nfps: {}\n",
      camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, lens.name,
      fmt::join(camera.distortion.begin(), camera.distortion.begin() + CoefficientCount(camera.lens), ", "),
      lens.coefficients, value.fps);
  if (camera.readout_s > 0) {
    text += fmt::format("readout_s: {}  # rolling shutter: from the first to the last row\n", camera.readout_s);
  }
  if (value.depth_scale > 0) {
    text += fmt::format("depth_scale: {}  # z = value * depth_scale; z depth, not ray length\n", value.depth_scale);
  }
  if (!value.world_up.empty()) text += fmt::format("world_up: {}  # in the world of the poses\n", value.world_up);
  return WriteFile(path, text);
}

}  // namespace romap::files
