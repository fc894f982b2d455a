#include "client/files/yaml_value.h"

#include "client/files/text_file.h"

namespace romap::files {
namespace {

int LineOf(const YAML::Node& node) { return node.Mark().line + 1; }

std::optional<double> AsNumber(const YAML::Node& node) {
  if (!node.IsScalar()) return std::nullopt;
  return ParseNumber(node.Scalar());
}

}  // namespace

absl::StatusOr<YAML::Node> LoadYamlMap(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(path));
  try {
    YAML::Node root = YAML::Load(text);
    if (!root.IsMap()) return InvalidArgument("{}: expected a YAML map of 'key: value' lines", path);
    return root;
  } catch (const YAML::Exception& e) {
    return InvalidArgument("{}:{}: invalid YAML: {}", path, e.mark.line + 1, e.msg);
  }
}

absl::StatusOr<double> YamlNumber(const YAML::Node& map, const std::string& key, const std::string& path) {
  const YAML::Node node = map[key];
  if (!node) return InvalidArgument("{}:{}: '{}' is missing", path, LineOf(map), key);
  const std::optional<double> number = AsNumber(node);
  if (!number) return InvalidArgument("{}:{}: '{}' is not a finite number", path, LineOf(node), key);
  return *number;
}

absl::StatusOr<std::vector<double>> YamlNumbers(const YAML::Node& map, const std::string& key, size_t count,
                                                const std::string& path) {
  const YAML::Node node = map[key];
  if (!node) return InvalidArgument("{}:{}: '{}' is missing", path, LineOf(map), key);
  if (!node.IsSequence() || node.size() != count) {
    return InvalidArgument("{}:{}: expected '{}' to be a list of {} numbers", path, LineOf(node), key, count);
  }
  std::vector<double> numbers;
  for (const YAML::Node& item : node) {
    const std::optional<double> number = AsNumber(item);
    if (!number)
      return InvalidArgument("{}:{}: '{}' contains a value that is not a finite number", path, LineOf(item), key);
    numbers.push_back(*number);
  }
  return numbers;
}

std::string YamlText(const YAML::Node& map, const std::string& key, const std::string& fallback) {
  const YAML::Node node = map[key];
  return node && node.IsScalar() ? node.Scalar() : fallback;
}

}  // namespace romap::files
