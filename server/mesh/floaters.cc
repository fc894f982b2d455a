#include "server/mesh/floaters.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace romap::mesh {
namespace {

// Consecutive connected nodes of one row of the grid (along x).
struct Run {
  int begin, end;   // x of the first node, and one past the last
  uint32_t parent;  // a run of the same component; the root is its own parent
  uint32_t size;    // nodes inside the surface; for the root those of the whole component
};

// The connected components of solid nodes: runs that touch over faces, edges or corners of cells, joined row by row
// (Rosenfeld and Pfaltz, 1966).
class Components {
 public:
  Components(const FieldGrid& grid, float connect_value) : grid_(grid), connect_value_(connect_value) {
    const int rows = grid.nodes.y() * grid.nodes.z();
    first_run_.reserve(static_cast<size_t>(rows) + 1);
    for (int row = 0; row < rows; ++row) {
      first_run_.push_back(static_cast<uint32_t>(runs_.size()));
      AddRuns(row);
    }
    first_run_.push_back(static_cast<uint32_t>(runs_.size()));
    // The neighboring rows in y and z. At the first and last row of a layer these wrap into another layer, which is
    // harmless because the rows of the ring are empty.
    for (int row = grid.nodes.y() + 1; row < rows; ++row) {
      for (const int step : {1, grid.nodes.y() - 1, grid.nodes.y(), grid.nodes.y() + 1}) JoinRows(row, row - step);
    }
  }

  size_t Largest() const {
    uint32_t largest = 0;
    for (const Run& run : runs_) largest = std::max(largest, run.size);
    return largest;
  }

  // Calls visit(first node, number of nodes, size of the component) for each run.
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

  // Joins the components of the runs of two rows that touch.
  void JoinRows(int row_a, int row_b) {
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
  std::vector<uint32_t> first_run_;  // by row, and the end of the last row
};

}  // namespace

size_t RemoveFloaters(FieldGrid& grid, float connect_value, double min_share) {
  Components components(grid, connect_value);
  const double min_size = min_share * static_cast<double>(components.Largest());
  size_t remaining = 0;
  components.ForEachRun([&](size_t first, size_t nodes, size_t component_size) {
    for (size_t node = first; node < first + nodes; ++node) {
      if (!(grid.value[node] > 0)) continue;
      if (static_cast<double>(component_size) < min_size) {
        grid.Edit(node, kEmpty);
      } else {
        ++remaining;
      }
    }
  });
  return remaining;
}

}  // namespace romap::mesh
