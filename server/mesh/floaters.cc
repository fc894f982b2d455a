#include "server/mesh/floaters.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "server/mesh/grid_flood.h"

namespace romap {
namespace {

constexpr uint32_t kNoPiece = 0;

// Index steps to the 20 nodes around a node that share an edge or a corner of a cell with it, but no side.
std::array<ptrdiff_t, 20> DiagonalSteps(const FieldGrid& grid) {
  std::array<ptrdiff_t, 20> steps;
  size_t count = 0;
  for (int z = -1; z <= 1; ++z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        if (std::abs(x) + std::abs(y) + std::abs(z) < 2) continue;
        steps[count++] = x + y * static_cast<ptrdiff_t>(grid.StrideY()) + z * static_cast<ptrdiff_t>(grid.StrideZ());
      }
    }
  }
  return steps;
}

class Pieces {
 public:
  Pieces(const FieldGrid& grid, float connect_value)
      : grid_(grid),
        connect_value_(connect_value),
        sides_(NeighbourSteps(grid)),
        diagonals_(DiagonalSteps(grid)),
        piece_of_(grid.value.size(), kNoPiece) {
    for (size_t seed = 0; seed < grid.value.size(); ++seed) {
      if (grid.value[seed] > 0 && piece_of_[seed] == kNoPiece) Collect(seed);
    }
  }

  // Of the node's piece: nodes inside the surface.
  size_t SizeAt(size_t node) const { return size_[piece_of_[node]]; }
  size_t Largest() const { return *std::max_element(size_.begin(), size_.end()); }

 private:
  void Collect(size_t seed) {
    size_.push_back(0);
    Enter(seed);
    while (!stack_.empty()) {
      const size_t node = stack_.back();
      stack_.pop_back();
      bool inner = true;
      for (const ptrdiff_t step : sides_) inner &= Enter(node + step);
      if (inner) continue;  // then its neighbours reach all that lies across its corners
      for (const ptrdiff_t step : diagonals_) Enter(node + step);
    }
  }

  // Whether the node belongs to the piece.
  bool Enter(size_t node) {
    if (!(grid_.value[node] > connect_value_)) return false;
    if (piece_of_[node] == kNoPiece) {
      piece_of_[node] = static_cast<uint32_t>(size_.size() - 1);
      size_.back() += grid_.value[node] > 0;
      stack_.push_back(node);
    }
    return true;
  }

  const FieldGrid& grid_;
  const float connect_value_;
  const std::array<ptrdiff_t, 6> sides_;
  const std::array<ptrdiff_t, 20> diagonals_;
  std::vector<uint32_t> piece_of_;  // by node
  std::vector<size_t> size_ = {0};  // by piece; [kNoPiece] unused
  std::vector<size_t> stack_;
};

}  // namespace

size_t RemoveFloaters(FieldGrid& grid, float connect_value, double min_share) {
  const Pieces pieces(grid, connect_value);
  const double least = min_share * static_cast<double>(pieces.Largest());
  size_t remaining = 0;
  for (size_t node = 0; node < grid.value.size(); ++node) {
    if (!(grid.value[node] > 0)) continue;
    if (static_cast<double>(pieces.SizeAt(node)) < least) {
      grid.Edit(node, kEmpty);
    } else {
      ++remaining;
    }
  }
  return remaining;
}

}  // namespace romap
