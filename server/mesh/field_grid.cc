#include "server/mesh/field_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace romap {
namespace {

// Large enough for the sampler's SIMD loops, small enough to stay in the cache.
constexpr size_t kBatchPoints = 8192;
// Beyond any trained value; keeps differences of raw values finite.
constexpr float kMaxRaw = 1e4f;

// Which hull cell the nodes 1..resolution of one axis lie in. A node between two cells belongs to the upper one.
std::vector<int> HullCellOfNode(int resolution, int hull_resolution) {
  std::vector<int> cell(resolution + 1, 0);
  for (int node = 1; node <= resolution; ++node) {
    const int64_t scaled = static_cast<int64_t>(node - 1) * hull_resolution / (resolution - 1);
    cell[node] = std::min<int>(static_cast<int>(scaled), hull_resolution - 1);
  }
  return cell;
}

// Collects nodes and asks the field for a batch of them at a time.
class NodeBatch {
 public:
  NodeBatch(const FieldSampler& field, FieldGrid& grid) : field_(field), grid_(grid) {
    points_.reserve(kBatchPoints);
    indices_.reserve(kBatchPoints);
    raw_.resize(kBatchPoints);
  }

  void Add(int x, int y, int z) {
    points_.push_back(grid_.Position(Eigen::Vector3f(x, y, z)));
    indices_.push_back(grid_.Index(x, y, z));
    if (points_.size() == kBatchPoints) Flush();
  }

  void Flush() {
    if (points_.empty()) return;
    field_.Sample(points_, std::span<float>(raw_).first(points_.size()), {});
    for (size_t i = 0; i < points_.size(); ++i) {
      grid_.raw[indices_[i]] = std::isnan(raw_[i]) ? kEmptyRaw : std::clamp(raw_[i], kEmptyRaw, kMaxRaw);
    }
    points_.clear();
    indices_.clear();
  }

 private:
  const FieldSampler& field_;
  FieldGrid& grid_;
  std::vector<Eigen::Vector3f> points_;
  std::vector<size_t> indices_;
  std::vector<float> raw_;
};

}  // namespace

FieldGrid MakeEmptyGrid(int resolution, const Eigen::Vector3f& half_extents) {
  FieldGrid grid;
  grid.nodes_per_side = resolution + 2;
  grid.spacing = 2.0f * half_extents / static_cast<float>(resolution - 1);
  grid.origin = -half_extents - grid.spacing;
  grid.longest_side_mu = 2.0f * half_extents.maxCoeff();
  grid.raw.assign(grid.StrideZ() * grid.nodes_per_side, kBeyondBoxRaw);
  for (int z = 1; z <= resolution; ++z) {
    for (int y = 1; y <= resolution; ++y) std::fill_n(&grid.raw[grid.Index(1, y, z)], resolution, kEmptyRaw);
  }
  return grid;
}

FieldGrid SampleField(const FieldSnapshot& snapshot, int resolution) {
  FieldGrid grid = MakeEmptyGrid(resolution, snapshot.box_half_extents);
  const OccupancyBits& hull = snapshot.hull;
  const std::vector<int> cell = HullCellOfNode(resolution, std::max(hull.resolution, 1));
  NodeBatch batch(*snapshot.field, grid);
  for (int z = 1; z <= resolution; ++z) {
    for (int y = 1; y <= resolution; ++y) {
      const size_t row = (static_cast<size_t>(cell[z]) * hull.resolution + cell[y]) * hull.resolution;
      for (int x = 1; x <= resolution; ++x) {
        if (hull.resolution == 0 || hull.bits[row + cell[x]] != 0) batch.Add(x, y, z);
      }
    }
  }
  batch.Flush();
  return grid;
}

}  // namespace romap
