#include "server/mesh/view_votes.h"

#include <algorithm>

#include "server/mesh/view_depth.h"
#include "server/mesh/visibility.h"

namespace romap::mesh {
namespace {

constexpr size_t kMaxViews = 32;
// A ray hits the surface at this optical depth. Higher than for a point that counts as visible, because haze that is
// left in the inside of cups hides less then.
constexpr float kOpticalDepthAtSurface = 0.3f;

}  // namespace

std::vector<ViewVotes> CountViewVotes(const FieldGrid& grid, std::span<const size_t> nodes,
                                      const FieldSnapshot& snapshot) {
  const std::vector<float> optical_depth =
      NodeOpticalDepths(grid, snapshot.optics.surface_density_per_mu, kOpticalDepthAtSurface);
  std::vector<ViewVotes> votes(nodes.size());
  const size_t count = std::min(kMaxViews, snapshot.cameras.size());
  for (size_t k = 0; k < count; ++k) {
    const ViewDepth view(grid, optical_depth, kOpticalDepthAtSurface,
                         snapshot.cameras[k * snapshot.cameras.size() / count]);
    for (size_t i = 0; i < nodes.size(); ++i) {
      const ViewDepth::Relation relation = view.Relate(grid.Position(grid.NodeAt(nodes[i])));
      if (relation == ViewDepth::Relation::kUnknown) continue;
      ++votes[i].views;
      if (relation == ViewDepth::Relation::kInFront) ++votes[i].empty;
    }
  }
  return votes;
}

}  // namespace romap::mesh
