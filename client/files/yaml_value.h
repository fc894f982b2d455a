#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "common/status.h"

namespace romap::files {

// yaml-cpp throws; these turn its exceptions into statuses that name file and line.

// A YAML file whose top level is a map.
absl::StatusOr<YAML::Node> LoadYamlMap(const std::string& path);

// map[key] as a finite number; INVALID_ARGUMENT when missing or something else.
absl::StatusOr<double> YamlNumber(const YAML::Node& map, const std::string& key, const std::string& path);

// map[key] as a list of `count` finite numbers.
absl::StatusOr<std::vector<double>> YamlNumbers(const YAML::Node& map, const std::string& key, size_t count,
                                                const std::string& path);

// map[key] as text; `fallback` when it is not there or not a scalar.
std::string YamlText(const YAML::Node& map, const std::string& key, const std::string& fallback);

}  // namespace romap::files
