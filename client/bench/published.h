#pragma once

#include <optional>
#include <string_view>

namespace romap::bench {

// Results published for RO-MAP (Han et al., RA-L 2023), measured on an RTX 4090 with camera poses from its SLAM and
// meshes aligned with the truth by ICP.

struct PublishedQuality {
  double accuracy_cm, completion_cm, below_04_percent, below_1_percent;
};

struct PublishedModelSize {
  int log2_table_entries, hidden_layers;
  double accuracy_cm, completion_cm, iteration_ms;
};

// Table 1, by the id of the corresponding method here; nullopt if the paper has no such method.
constexpr std::optional<PublishedQuality> PublishedTable1(std::string_view method) {
  if (method == "fast" || method == "paper" || method == "sdf") return PublishedQuality{0.431, 0.248, 80.85, 98.93};
  if (method == "offline") return PublishedQuality{0.476, 0.228, 83.16, 99.38};
  if (method == "offline-depth") return PublishedQuality{0.259, 0.162, 93.69, 99.98};
  if (method == "colmap") return PublishedQuality{0.612, 0.656, 57.72, 81.17};
  return std::nullopt;
}

// Table 3 [ms]: one step of one object, and surface extraction.
inline constexpr double kPublishedSampling_ms = 0.0932;
inline constexpr double kPublishedForward_ms = 0.156;
inline constexpr double kPublishedBackward_ms = 0.455;
inline constexpr double kPublishedIteration_ms = 0.706;
inline constexpr double kPublishedMarchingCubes_ms = 2.84;

// Table 4.
inline constexpr PublishedModelSize kPublishedTable4[] = {{14, 1, 0.435, 0.227, 0.658}, {16, 1, 0.424, 0.233, 0.706},
                                                          {18, 1, 0.451, 0.236, 0.921}, {20, 1, 0.450, 0.243, 1.495},
                                                          {16, 2, 0.409, 0.241, 0.862}, {16, 3, 0.442, 0.243, 1.052}};

}  // namespace romap::bench
