#include "client/importers/yolo_masks.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>

#include "client/files/text_file.h"
#include "client/files/whole_number.h"
#include "client/files/yaml_value.h"
#include "client/importers/folder.h"

namespace romap::importers {
namespace {

constexpr size_t kMinFields = 7;  // a class and three corners

using ClassNames = std::map<int64_t, std::string>;

absl::StatusOr<ClassNames> NamesOfDataYaml(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const YAML::Node root, files::LoadYamlMap(path));
  const YAML::Node names = root["names"];
  ClassNames result;
  if (names && names.IsSequence()) {
    for (size_t k = 0; k < names.size(); ++k) {
      if (names[k].IsScalar()) result[static_cast<int64_t>(k)] = names[k].Scalar();
    }
  } else if (names && names.IsMap()) {
    for (const auto& entry : names) {
      const auto number = entry.first.IsScalar() ? files::ParseNumber(entry.first.Scalar()) : std::nullopt;
      const auto id = number ? files::WholeNumber(*number) : std::nullopt;
      if (id && entry.second.IsScalar()) result[*id] = entry.second.Scalar();
    }
  }
  if (result.empty()) return InvalidArgument("{}: 'names' is missing; expected the names of the classes", path);
  return result;
}

absl::StatusOr<ClassNames> FindClassNames(const std::string& folder) {
  std::filesystem::path at = std::filesystem::absolute(folder).lexically_normal();
  if (!at.has_filename()) at = at.parent_path();
  for (int level = 0; level < 3; ++level, at = at.parent_path()) {
    if (const auto yaml = FirstExisting(at.string(), {"data.yaml", "dataset.yaml"})) return NamesOfDataYaml(*yaml);
    const auto list = FirstExisting(at.string(), {"classes.txt"});
    if (!list) continue;
    ROMAP_ASSIGN_OR_RETURN(const std::vector<files::TextLine> lines, files::ReadLines(*list));
    ClassNames names;
    for (const files::TextLine& line : lines) names[static_cast<int64_t>(names.size())] = line.text;
    return names;
  }
  return ClassNames();
}

absl::StatusOr<MaskLayer> LayerOfLine(const files::TableLine& line, const ClassNames& names, const std::string& path,
                                      cv::Size size_px) {
  if (line.fields.size() == 5 || line.fields.size() == 6) {
    return InvalidArgument("{}:{}: a box; expected a segmentation, 'class x y x y x y ...'", path, line.number);
  }
  if (line.fields.size() < kMinFields) {
    return InvalidArgument("{}:{}: {} fields; expected 'class x y x y x y ...'", path, line.number, line.fields.size());
  }
  std::vector<double> numbers;
  for (const std::string& field : line.fields) {
    const std::optional<double> number = files::ParseNumber(field);
    if (!number) return InvalidArgument("{}:{}: '{}' is not a number", path, line.number, field);
    numbers.push_back(*number);
  }
  const std::optional<int64_t> id = files::WholeNumber(numbers.front());
  if (!id) return InvalidArgument("{}:{}: class '{}' is not a whole number", path, line.number, line.fields.front());
  MaskLayer layer;
  if (numbers.size() % 2 == 0) {
    layer.score = std::clamp(numbers.back(), 0.0, 1.0);
    numbers.pop_back();
  }
  numbers.erase(numbers.begin());
  for (size_t k = 0; k < numbers.size(); ++k) {
    if (numbers[k] < -0.01 || numbers[k] > 1.01) {
      return InvalidArgument("{}:{}: coordinate {}; expected 0 to 1 (normalized by the size of the image)", path,
                             line.number, numbers[k]);
    }
    numbers[k] *= k % 2 == 0 ? size_px.width : size_px.height;
  }
  layer.pixels = FillPolygon(numbers, size_px);
  const auto name = names.find(*id);
  layer.class_name = name == names.end() ? fmt::format("class_{}", *id) : name->second;
  return layer;
}

}  // namespace

absl::StatusOr<std::vector<NamedMasks>> ReadYoloMasks(const std::string& folder, cv::Size size_px) {
  ROMAP_ASSIGN_OR_RETURN(ClassNames found, FindClassNames(folder));
  const auto names = std::make_shared<const ClassNames>(std::move(found));
  std::vector<NamedMasks> all;
  for (const std::string& name : FileNames(folder, ".txt")) {
    if (name == "classes.txt") continue;
    const std::string path = folder + "/" + name;
    all.push_back({StemOf(name), path, [path, names, size_px]() -> absl::StatusOr<EncodedMasks> {
                     ROMAP_ASSIGN_OR_RETURN(const std::vector<files::TableLine> lines, files::ReadTable(path));
                     std::vector<MaskLayer> layers;
                     for (const files::TableLine& line : lines) {
                       ROMAP_ASSIGN_OR_RETURN(layers.emplace_back(), LayerOfLine(line, *names, path, size_px));
                     }
                     return EncodeLayers(layers, size_px);
                   }});
  }
  return all;
}

}  // namespace romap::importers
