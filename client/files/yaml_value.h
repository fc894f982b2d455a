#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "common/status.h"

namespace romap::files {

// Access to YAML values. Converts the exceptions of yaml-cpp to statuses that name the file and the line. `path` is the
// file name for messages.

// Loads a YAML file whose top level is a map. INVALID_ARGUMENT if it is malformed; otherwise as ReadFile.
absl::StatusOr<YAML::Node> LoadYamlMap(const std::string& path);

// Returns map[key] as a finite number. INVALID_ARGUMENT if missing or not a finite number.
absl::StatusOr<double> YamlNumber(const YAML::Node& map, const std::string& key, const std::string& path);

// Returns map[key] as a list of `count` finite numbers. INVALID_ARGUMENT if missing or not such a list.
absl::StatusOr<std::vector<double>> YamlNumbers(const YAML::Node& map, const std::string& key, size_t count,
                                                const std::string& path);

// Returns map[key] as text, or `fallback` if it is missing or not a scalar.
std::string YamlText(const YAML::Node& map, const std::string& key, const std::string& fallback);

}  // namespace romap::files
