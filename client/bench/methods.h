#pragma once

#include <string>
#include <vector>

#include "common/status.h"
#include "server/mesh/mesh_config.h"
#include "server/nerf/nerf_config.h"

namespace romap::bench {

// A row of a table: a method to reconstruct a surface from views, as engine settings.
struct BenchMethod {
  std::string id;                          // for files and --methods: letters, digits, _ and -
  std::string title;                       // display name
  std::vector<std::string> settings = {};  // "section.field=value", applied to the defaults
  bool with_depth = false;                 // train with the true depth images
  bool trained = true;                     // false: only the visual hull
};

struct EngineConfig {
  nerf::NerfConfig nerf;
  mesh::MeshConfig mesh;
};

// Applies `base` and then the settings of the method to the defaults. INVALID_ARGUMENT: an unknown field or a value out
// of range.
absl::StatusOr<EngineConfig> Configure(const BenchMethod& method, const std::vector<std::string>& base);

// The rows of the paper's Table 1 and further methods: four variants of this implementation, the offline method [33]
// with and without depth and with the losses of the paper (L_rgb + L_rr, + L_depth), the visual hull, and per-object
// MLPs with frequency encoding and depth in the sizes of iMAP (4 x 256) and vMAP (4 x 32).
std::vector<BenchMethod> Table1Methods();

// The models of the paper's Table 4: hash tables of 2^14 to 2^20 entries, one to three hidden layers. Everything else
// is as in the fast preset.
std::vector<BenchMethod> ModelSizeMethods();

// The fast preset with one component removed or changed at a time.
std::vector<BenchMethod> AblationMethods();

// Parses "ID: nerf.a=1 nerf.b=2" to a method with this id and title. INVALID_ARGUMENT if malformed.
absl::StatusOr<BenchMethod> ParseMethod(const std::string& text);

}  // namespace romap::bench
