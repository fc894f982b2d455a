#pragma once

#include <string>
#include <vector>

#include "common/status.h"
#include "server/mesh/mesh_config.h"
#include "server/nerf/nerf_config.h"

namespace romap::bench {

// A row of a table: one way to get from views to a surface, as settings of the engine.
struct BenchMethod {
  std::string id;                          // for files and --methods: letters, digits, _ and -
  std::string title;                       // for people
  std::vector<std::string> settings = {};  // "section.field=value" on top of the defaults
  bool with_depth = false;                 // trains on the true depth images
  bool trained = true;                     // false: the visual hull alone
};

struct EngineConfig {
  nerf::NerfConfig nerf;
  mesh::MeshConfig mesh;
};

// The defaults, then `base`, then the method's own settings. INVALID_ARGUMENT: a field is unknown or out of range.
absl::StatusOr<EngineConfig> Configure(const BenchMethod& method, const std::vector<std::string>& base);

// The rows of the paper's Table 1, and what is compared with it beyond: ours in four forms, the offline method [33]
// with and without depth with the losses the paper gives it (L_rgb + L_rr, + L_depth), the visual hull, and per-object
// MLPs of the sizes of iMAP (4 x 256) and vMAP (4 x 32) on frequency encodings, with depth.
std::vector<BenchMethod> Table1Methods();

// The models of the paper's Table 4: hash tables of 2^14 to 2^20 entries, one to three hidden layers. All else is as in
// the fast preset.
std::vector<BenchMethod> ModelSizeMethods();

// The fast preset with one part taken out or changed at a time.
std::vector<BenchMethod> AblationMethods();

// "ID: nerf.a=1 nerf.b=2" as a method of that id and title. INVALID_ARGUMENT says what it should look like.
absl::StatusOr<BenchMethod> ParseMethod(const std::string& text);

}  // namespace romap::bench
