#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/status.h"

namespace romap::importers {

// Access to JSON values. `where` names the file and the place in messages. INVALID_ARGUMENT: missing, or of another
// type.

// Loads a JSON file; comments are allowed. Errors as ReadFile, or INVALID_ARGUMENT if it is malformed.
absl::StatusOr<nlohmann::json> LoadJson(const std::string& path);

absl::StatusOr<double> JsonNumber(const nlohmann::json& object, const std::string& key, const std::string& where);
// `fallback` if the key is missing.
absl::StatusOr<double> JsonNumberOr(const nlohmann::json& object, const std::string& key, double fallback,
                                    const std::string& where);
// As an integer.
absl::StatusOr<int64_t> JsonWhole(const nlohmann::json& object, const std::string& key, const std::string& where);
// An image side in pixels, also written as 1080.0.
absl::StatusOr<int> JsonSide(const nlohmann::json& object, const std::string& key, const std::string& where);
absl::StatusOr<std::string> JsonText(const nlohmann::json& object, const std::string& key, const std::string& where);
// All numbers of a list, or of a list of lists.
absl::StatusOr<std::vector<double>> JsonNumbers(const nlohmann::json& object, const std::string& key,
                                                const std::string& where);
// The pinhole camera of the keys fx, fy, cx, cy and of those of its sides, e.g. "width" and "height"; the principal
// point as in the file.
absl::StatusOr<CameraModel> JsonCamera(const nlohmann::json& object, const std::string& width_key,
                                       const std::string& height_key, const std::string& where);
// A list of objects.
absl::StatusOr<const nlohmann::json*> JsonObjects(const nlohmann::json& object, const std::string& key,
                                                  const std::string& where);

}  // namespace romap::importers
