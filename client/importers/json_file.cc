#include "client/importers/json_file.h"

#include <cmath>

#include "client/files/text_file.h"
#include "client/files/whole_number.h"

namespace romap::importers {
namespace {

// Far more than any format needs. Without a limit, functions that call themselves for each level, also those of the
// library, would use up the stack.
constexpr int kMaxJsonDepth = 64;

bool AppendNumbers(const nlohmann::json& value, std::vector<double>* numbers) {
  if (value.is_number()) {
    numbers->push_back(value.get<double>());
    return true;
  }
  if (!value.is_array()) return false;
  for (const nlohmann::json& item : value) {
    if (!AppendNumbers(item, numbers)) return false;
  }
  return true;
}

}  // namespace

absl::StatusOr<nlohmann::json> LoadJson(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::string text, files::ReadTextFile(path));
  bool is_too_deep = false;
  const auto keep = [&](int depth, nlohmann::json::parse_event_t /*event*/, const nlohmann::json& /*value*/) {
    is_too_deep = is_too_deep || depth > kMaxJsonDepth;
    return !is_too_deep;
  };
  try {
    nlohmann::json json = nlohmann::json::parse(text, keep, /*allow_exceptions=*/true, /*ignore_comments=*/true);
    if (is_too_deep) return InvalidArgument("{}: the JSON has more than {} levels", path, kMaxJsonDepth);
    return json;
  } catch (const nlohmann::json::exception& e) {
    return InvalidArgument("{}: invalid JSON: {}", path, e.what());
  }
}

absl::StatusOr<double> JsonNumber(const nlohmann::json& object, const std::string& key, const std::string& where) {
  const auto value = object.is_object() ? object.find(key) : object.end();
  if (value == object.end()) return InvalidArgument("{}: '{}' is missing; expected a number", where, key);
  if (!value->is_number() || !std::isfinite(value->get<double>())) {
    return InvalidArgument("{}: '{}' is {}; expected a number", where, key, value->dump());
  }
  return value->get<double>();
}

absl::StatusOr<double> JsonNumberOr(const nlohmann::json& object, const std::string& key, double fallback,
                                    const std::string& where) {
  if (!object.is_object() || !object.contains(key)) return fallback;
  return JsonNumber(object, key, where);
}

absl::StatusOr<int64_t> JsonWhole(const nlohmann::json& object, const std::string& key, const std::string& where) {
  ROMAP_ASSIGN_OR_RETURN(const double number, JsonNumber(object, key, where));
  const std::optional<int64_t> whole = files::WholeNumber(number);
  if (!whole) return InvalidArgument("{}: '{}' is {}; expected a whole number", where, key, number);
  return *whole;
}

absl::StatusOr<int> JsonSide(const nlohmann::json& object, const std::string& key, const std::string& where) {
  ROMAP_ASSIGN_OR_RETURN(const double side_px, JsonNumber(object, key, where));
  if (side_px < 1 || side_px > 1e6 || side_px != std::floor(side_px)) {
    return InvalidArgument("{}: '{}' is {}; expected a whole number of pixels", where, key, side_px);
  }
  return static_cast<int>(side_px);
}

absl::StatusOr<std::string> JsonText(const nlohmann::json& object, const std::string& key, const std::string& where) {
  const auto value = object.is_object() ? object.find(key) : object.end();
  if (value == object.end() || !value->is_string()) {
    return InvalidArgument("{}: '{}' is missing or not a text", where, key);
  }
  return value->get<std::string>();
}

absl::StatusOr<std::vector<double>> JsonNumbers(const nlohmann::json& object, const std::string& key,
                                                const std::string& where) {
  const auto value = object.is_object() ? object.find(key) : object.end();
  std::vector<double> numbers;
  if (value == object.end() || !value->is_array() || !AppendNumbers(*value, &numbers)) {
    return InvalidArgument("{}: '{}' is missing or not a list of numbers", where, key);
  }
  return numbers;
}

absl::StatusOr<const nlohmann::json*> JsonObjects(const nlohmann::json& object, const std::string& key,
                                                  const std::string& where) {
  const auto value = object.is_object() ? object.find(key) : object.end();
  if (value == object.end() || !value->is_array()) {
    return InvalidArgument("{}: the list '{}' is missing", where, key);
  }
  for (const nlohmann::json& item : *value) {
    if (!item.is_object()) return InvalidArgument("{}: '{}' contains something that is no object", where, key);
  }
  return &*value;
}

absl::StatusOr<CameraModel> JsonCamera(const nlohmann::json& object, const std::string& width_key,
                                       const std::string& height_key, const std::string& where) {
  CameraModel camera;
  ROMAP_ASSIGN_OR_RETURN(camera.width_px, JsonSide(object, width_key, where));
  ROMAP_ASSIGN_OR_RETURN(camera.height_px, JsonSide(object, height_key, where));
  ROMAP_ASSIGN_OR_RETURN(camera.fx_px, JsonNumber(object, "fx", where));
  ROMAP_ASSIGN_OR_RETURN(camera.fy_px, JsonNumber(object, "fy", where));
  ROMAP_ASSIGN_OR_RETURN(camera.cx_px, JsonNumber(object, "cx", where));
  ROMAP_ASSIGN_OR_RETURN(camera.cy_px, JsonNumber(object, "cy", where));
  return camera;
}

}  // namespace romap::importers
