#include "client/files/objects_yaml.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "client/files/text_file.h"
#include "client/files/yaml_value.h"

namespace romap::files {
namespace {

absl::StatusOr<SE3<World, Object>> ReadPose(const YAML::Node& node, const std::string& path) {
  if (!node["T_world_object"]) {
    ROMAP_ASSIGN_OR_RETURN(const double yaw_rad, YamlNumber(node, "yaw", path));
    ROMAP_ASSIGN_OR_RETURN(const std::vector<double> center, YamlNumbers(node, "center", 3, path));
    return SE3<World, Object>(Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ())),
                              Eigen::Vector3d(center.data()));
  }
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> numbers, YamlNumbers(node, "T_world_object", 16, path));
  const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  if ((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > 1e-3 ||
      rotation.determinant() < 0) {
    return InvalidArgument("{}:{}: the rotation of T_world_object is not orthonormal and right-handed", path,
                           node["T_world_object"].Mark().line + 1);
  }
  return SE3<World, Object>(rotation, Eigen::Vector3d(matrix.topRightCorner<3, 1>()));
}

absl::StatusOr<ObjectRecord> ReadRecord(const YAML::Node& node, size_t index, const std::string& path) {
  if (!node.IsMap()) return InvalidArgument("{}: entry {} of 'objects' is not a YAML map", path, index + 1);
  ObjectRecord record;
  const std::string where = fmt::format("{}:{}: object {}", path, node.Mark().line + 1, YamlText(node, "id", ""));
  ROMAP_ASSIGN_OR_RETURN(const double id, YamlNumber(node, "id", path));
  if (id < 0 || id > 9e15 || id != std::floor(id))
    return InvalidArgument("{}: 'id' must be a non-negative integer", where);
  record.id = static_cast<int64_t>(id);
  record.class_name = YamlText(node, "class", "");
  record.name = YamlText(node, "name", record.class_name.empty() ? std::to_string(record.id) : record.class_name);
  ROMAP_ASSIGN_OR_RETURN(record.T_world_object, ReadPose(node, path));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> half_extents, YamlNumbers(node, "half_extents", 3, path));
  record.half_extents = Eigen::Vector3d(half_extents.data());
  if (record.half_extents.minCoeff() <= 0) return InvalidArgument("{}: 'half_extents' must be positive", where);
  if (node["confidence"]) {
    ROMAP_ASSIGN_OR_RETURN(record.confidence, YamlNumber(node, "confidence", path));
  }
  return record;
}

std::vector<double> RowMajor(const SE3<World, Object>& pose) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = pose.Matrix();
  return {matrix.data(), matrix.data() + matrix.size()};
}

// Quotes a string as JSON, which is also valid YAML.
std::string Quoted(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string ToYaml(const ObjectsYaml& value) {
  std::string text = fmt::format(
      "# T_world_object: row-major 4x4, object frame (cuboid center) to world; half_extents along the object's axes\n"
      "world_up: [{:.9f}, {:.9f}, {:.9f}]\nobjects:\n",
      value.up_world.x(), value.up_world.y(), value.up_world.z());
  for (const ObjectRecord& record : value.objects) {
    const Eigen::Vector3d& h = record.half_extents;
    text += fmt::format(
        "  - id: {}\n    name: {}\n    class: {}\n    T_world_object: [{:.9f}]\n"
        "    half_extents: [{:.9f}, {:.9f}, {:.9f}]\n",
        record.id, Quoted(record.name), Quoted(record.class_name), fmt::join(RowMajor(record.T_world_object), ", "),
        h.x(), h.y(), h.z());
    if (record.confidence) text += fmt::format("    confidence: {:.6f}\n", *record.confidence);
  }
  return text;
}

std::string ToJson(const ObjectsYaml& value) {
  nlohmann::ordered_json root;
  root["world_up"] = {value.up_world.x(), value.up_world.y(), value.up_world.z()};
  root["objects"] = nlohmann::ordered_json::array();
  for (const ObjectRecord& record : value.objects) {
    const Eigen::Vector3d& h = record.half_extents;
    nlohmann::ordered_json entry = {{"id", record.id}, {"class", record.class_name}, {"name", record.name}};
    entry["T_world_object"] = RowMajor(record.T_world_object);
    entry["half_extents"] = {h.x(), h.y(), h.z()};
    if (record.confidence) entry["confidence"] = *record.confidence;
    root["objects"].push_back(std::move(entry));
  }
  return root.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace

absl::StatusOr<ObjectsYaml> ReadObjects(const std::string& path) {
  // JSON is a subset of YAML.
  ROMAP_ASSIGN_OR_RETURN(const YAML::Node root, LoadYamlMap(path));
  ObjectsYaml result;
  if (root["world_up"]) {
    ROMAP_ASSIGN_OR_RETURN(const std::vector<double> up, YamlNumbers(root, "world_up", 3, path));
    result.up_world = Eigen::Vector3d(up.data());
    if (result.up_world.norm() < 1e-6) return InvalidArgument("{}: 'world_up' must not be the zero vector", path);
    result.up_world.normalize();
  }
  const YAML::Node objects = root["objects"];
  if (!objects || !(objects.IsSequence() || objects.IsNull())) {
    return InvalidArgument("{}: the list 'objects:' is missing", path);
  }
  for (size_t k = 0; k < objects.size(); ++k) {
    ROMAP_ASSIGN_OR_RETURN(ObjectRecord record, ReadRecord(objects[k], k, path));
    result.objects.push_back(std::move(record));
  }
  return result;
}

absl::Status WriteObjects(const std::string& path, const ObjectsYaml& objects) {
  return WriteFile(path, path.ends_with(".json") ? ToJson(objects) : ToYaml(objects));
}

}  // namespace romap::files
