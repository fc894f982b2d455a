#include "server/mesh/floaters.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace romap::mesh {
namespace {

// Neighbouring nodes of one row of the grid (along x) that hang together.
struct Run {
  int begin, end;   // x of the first, and behind the last
  uint32_t parent;  // a run of the same piece, itself for the one that stands for all
  uint32_t size;    // nodes inside the surface; of the whole piece where the run stands for it
};

// The pieces of matter: runs that touch over sides, edges or corners of cells, united row by row (Rosenfeld and Pfaltz,
// 1966).
class Pieces {
 public:
  Pieces(const FieldGrid& grid, float connect_value) : grid_(grid), connect_value_(connect_value) {
    const int rows = grid.nodes.y() * grid.nodes.z();
    first_run_.reserve(static_cast<size_t>(rows) + 1);
    for (int row = 0; row < rows; ++row) {
      first_run_.push_back(static_cast<uint32_t>(runs_.size()));
      AddRuns(row);
    }
    first_run_.push_back(static_cast<uint32_t>(runs_.size()));
    // The rows of the ring are empty, so that none of these is beside a row of the next or last layer.
    for (int row = grid.nodes.y() + 1; row < rows; ++row) {
      for (const int step : {1, grid.nodes.y() - 1, grid.nodes.y(), grid.nodes.y() + 1}) Unite(row, row - step);
    }
  }

  size_t Largest() const {
    uint32_t largest = 0;
    for (const Run& run : runs_) largest = std::max(largest, run.size);
    return largest;
  }

  // Calls visit(first node, nodes, size of its piece) for each run.
  template <class Visit>
  void ForEachRun(Visit visit) {
    for (size_t row = 0; row + 1 < first_run_.size(); ++row) {
      for (uint32_t i = first_run_[row]; i < first_run_[row + 1]; ++i) {
        const Run& run = runs_[i];
        visit(row * grid_.StrideY() + static_cast<size_t>(run.begin), static_cast<size_t>(run.end - run.begin),
              static_cast<size_t>(runs_[Root(i)].size));
      }
    }
  }

 private:
  void AddRuns(int row) {
    const float* value = &grid_.value[static_cast<size_t>(row) * grid_.StrideY()];
    for (int x = 0; x < grid_.nodes.x(); ++x) {
      if (!(value[x] > connect_value_)) continue;
      Run run{.begin = x, .end = x, .parent = static_cast<uint32_t>(runs_.size()), .size = 0};
      for (; run.end < grid_.nodes.x() && value[run.end] > connect_value_; ++run.end) run.size += value[run.end] > 0;
      x = run.end;
      runs_.push_back(run);
    }
  }

  // Unites the pieces of runs of two rows that touch each other.
  void Unite(int row_a, int row_b) {
    uint32_t a = first_run_[static_cast<size_t>(row_a)], b = first_run_[static_cast<size_t>(row_b)];
    const uint32_t end_a = first_run_[static_cast<size_t>(row_a) + 1];
    const uint32_t end_b = first_run_[static_cast<size_t>(row_b) + 1];
    while (a < end_a && b < end_b) {
      if (runs_[a].begin <= runs_[b].end && runs_[b].begin <= runs_[a].end) Join(a, b);
      runs_[a].end < runs_[b].end ? ++a : ++b;
    }
  }

  void Join(uint32_t a, uint32_t b) {
    a = Root(a);
    b = Root(b);
    if (a == b) return;
    if (a > b) std::swap(a, b);
    runs_[b].parent = a;
    runs_[a].size += runs_[b].size;
  }

  uint32_t Root(uint32_t run) {
    while (runs_[run].parent != run) run = runs_[run].parent = runs_[runs_[run].parent].parent;
    return run;
  }

  const FieldGrid& grid_;
  const float connect_value_;
  std::vector<Run> runs_;            // row after row, by x
  std::vector<uint32_t> first_run_;  // by row, and where the last row ends
};

}  // namespace

size_t RemoveFloaters(FieldGrid& grid, float connect_value, double min_share) {
  Pieces pieces(grid, connect_value);
  const double least = min_share * static_cast<double>(pieces.Largest());
  size_t remaining = 0;
  pieces.ForEachRun([&](size_t first, size_t nodes, size_t size_of_piece) {
    for (size_t node = first; node < first + nodes; ++node) {
      if (!(grid.value[node] > 0)) continue;
      if (static_cast<double>(size_of_piece) < least) {
        grid.Edit(node, kEmpty);
      } else {
        ++remaining;
      }
    }
  });
  return remaining;
}

}  // namespace romap::mesh
