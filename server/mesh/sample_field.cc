#include "server/mesh/sample_field.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "server/mesh/grid_flood.h"

namespace romap::mesh {
namespace {

// Large enough for the sampler's SIMD loops, small enough for the cache.
constexpr size_t kBatchPoints = 8192;
// A node with a smaller value (e^-6 of the surface's density) is not near the surface.
constexpr float kClearlyEmpty = -6.0f;
// Nodes outside the hull or the box contribute this value to a mean: empty, but finite.
constexpr float kMinForMean = -16.0f;

// kDecided: outside the hull or in the ring.
enum State : uint8_t { kDecided, kUnknown, kInterpolated, kSampled };

// The hull cell that contains each of the nodes 1..nodes of one axis. A node between two cells belongs to the upper
// one.
std::vector<int> HullCellOfNode(int nodes, int hull_resolution) {
  std::vector<int> cell(static_cast<size_t>(nodes) + 1, 0);
  for (int node = 1; node <= nodes; ++node) {
    const int64_t scaled = static_cast<int64_t>(node - 1) * hull_resolution / (nodes - 1);
    cell[static_cast<size_t>(node)] = std::min<int>(static_cast<int>(scaled), hull_resolution - 1);
  }
  return cell;
}

class FieldSampling {
 public:
  FieldSampling(const FieldSnapshot& snapshot, const SurfaceProbe& probe, const Eigen::Vector3i& box_nodes)
      : probe_(probe), grid_(MakeEmptyGrid(box_nodes, snapshot.box_half_extents)), steps_(NeighborSteps(grid_)) {
    MarkHull(snapshot.hull);
  }

  SampledField Run() && {
    Sample(LatticeNodes());
    InterpolateBetweenLattice();
    SampleReachableSpace();
    FillUnreachedSpace();
    return {std::move(grid_), samples_};
  }

 private:
  void MarkHull(const OccupancyBits& hull) {
    state_.assign(grid_.value.size(), kDecided);
    const int side = hull.resolution;
    std::array<std::vector<int>, 3> cell;
    for (int axis = 0; axis < 3; ++axis) cell[axis] = HullCellOfNode(grid_.nodes[axis] - 2, std::max(side, 1));
    for (int z = 1; z < grid_.nodes.z() - 1; ++z) {
      for (int y = 1; y < grid_.nodes.y() - 1; ++y) {
        const size_t row = (static_cast<size_t>(cell[2][z]) * side + cell[1][y]) * side;
        uint8_t* state = &state_[grid_.Index(0, y, z)];
        for (int x = 1; x < grid_.nodes.x() - 1; ++x) {
          if (side == 0 || hull.bits[row + cell[0][x]] != 0) state[x] = kUnknown;
        }
      }
    }
  }

  template <class Visit>
  void ForEachUnknown(Visit visit) {
    for (int z = 1; z < grid_.nodes.z() - 1; ++z) {
      for (int y = 1; y < grid_.nodes.y() - 1; ++y) {
        const size_t row = grid_.Index(0, y, z);
        for (int x = 1; x < grid_.nodes.x() - 1; ++x) {
          if (state_[row + x] == kUnknown) visit(x, y, z, row + x);
        }
      }
    }
  }

  std::vector<size_t> LatticeNodes() {
    std::vector<size_t> nodes;
    ForEachUnknown([&](int x, int y, int z, size_t node) {
      if ((x & 1) == (y & 1) && (y & 1) == (z & 1)) nodes.push_back(node);
    });
    return nodes;
  }

  // Interpolates the nodes between lattice nodes that are all clearly empty.
  void InterpolateBetweenLattice() {
    const ptrdiff_t dy = static_cast<ptrdiff_t>(grid_.StrideY()), dz = static_cast<ptrdiff_t>(grid_.StrideZ());
    // The six lattice neighbors of a node, by the axis whose coordinate differs in parity from the other two.
    const std::array<std::array<ptrdiff_t, 6>, 3> neighbors = {{
        {-1, 1, -dy - dz, dy - dz, dz - dy, dy + dz},
        {-dy, dy, -1 - dz, 1 - dz, dz - 1, 1 + dz},
        {-dz, dz, -1 - dy, 1 - dy, dy - 1, 1 + dy},
    }};
    ForEachUnknown([&](int x, int y, int z, size_t node) {
      const int axis = (y & 1) == (z & 1) ? 0 : (x & 1) == (z & 1) ? 1 : 2;
      float largest = kBeyondBox, sum = 0;
      for (const ptrdiff_t step : neighbors[axis]) {
        largest = std::max(largest, grid_.value[node + step]);
        sum += std::max(grid_.value[node + step], kMinForMean);
      }
      if (largest >= kClearlyEmpty) return;
      grid_.value[node] = sum / 6.0f;
      state_[node] = kInterpolated;
    });
  }

  // Samples all nodes that can be reached from outside the hull through empty space, and the solid nodes that bound it.
  void SampleReachableSpace() {
    std::vector<size_t> wave = HullBorder();
    while (!wave.empty()) {
      std::vector<size_t> unknown;
      std::copy_if(wave.begin(), wave.end(), std::back_inserter(unknown),
                   [this](size_t node) { return state_[node] == kUnknown; });
      Sample(unknown);
      std::vector<size_t> next;
      for (const size_t node : wave) {
        for (const ptrdiff_t step : steps_) {
          const size_t neighbor = node + step;
          if (state_[neighbor] == kDecided) continue;
          // An interpolated value next to a node that is not clearly empty may be wrong.
          const bool uncertain = state_[neighbor] == kInterpolated && grid_.value[node] > kClearlyEmpty;
          if (uncertain) state_[neighbor] = kUnknown;
          const bool enter = reached_[neighbor] == 0 && !(grid_.value[node] > 0);
          if (!uncertain && !enter) continue;
          reached_[neighbor] = 1;
          next.push_back(neighbor);
        }
      }
      wave = std::move(next);
    }
  }

  std::vector<size_t> HullBorder() {
    reached_.assign(state_.size(), 0);
    std::vector<size_t> border;
    for (size_t node = 0; node < state_.size(); ++node) {
      if (state_[node] == kDecided) continue;
      const bool at_border =
          std::any_of(steps_.begin(), steps_.end(), [&](ptrdiff_t step) { return state_[node + step] == kDecided; });
      if (!at_border) continue;
      reached_[node] = 1;
      border.push_back(node);
    }
    return border;
  }

  void FillUnreachedSpace() {
    for (size_t node = 0; node < state_.size(); ++node) {
      if (state_[node] != kDecided && reached_[node] == 0 && !(grid_.value[node] > 0)) grid_.Edit(node, kSolid);
    }
  }

  void Sample(const std::vector<size_t>& nodes) {
    std::vector<Eigen::Vector3f> points(std::min(nodes.size(), kBatchPoints));
    std::vector<float> values(points.size());
    for (size_t begin = 0; begin < nodes.size(); begin += kBatchPoints) {
      const size_t count = std::min(kBatchPoints, nodes.size() - begin);
      for (size_t i = 0; i < count; ++i) points[i] = grid_.Position(grid_.NodeAt(nodes[begin + i]));
      probe_.Sample(std::span(points).first(count), std::span(values).first(count));
      for (size_t i = 0; i < count; ++i) {
        grid_.value[nodes[begin + i]] = values[i];
        state_[nodes[begin + i]] = kSampled;
      }
    }
    samples_ += nodes.size();
  }

  const SurfaceProbe& probe_;
  FieldGrid grid_;
  const std::array<ptrdiff_t, 6> steps_;
  std::vector<uint8_t> state_;
  std::vector<uint8_t> reached_;  // 1 = reached through empty space from outside the hull
  size_t samples_ = 0;
};

}  // namespace

SampledField SampleField(const FieldSnapshot& snapshot, const SurfaceProbe& probe, const Eigen::Vector3i& box_nodes) {
  return FieldSampling(snapshot, probe, box_nodes).Run();
}

}  // namespace romap::mesh
