#pragma once

#include <hwy/cache_control.h>

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Which cells of the training box are worth sampling: those of the visual hull near which samples have had weight.
class Occupancy {
 public:
  explicit Occupancy(const NerfConfig& config);

  // A new hull (kOccupancyResolution^3 cells, 1 = possible). Scores of cells stay.
  void SetHull(std::vector<uint8_t> hull);
  // Forgets the scores: all of the hull is occupied again.
  void Reset();
  // The cells cover another box from now on; SetHull() must follow. A cell's score is the largest that the old cells
  // under it had; cells outside the old box start occupied. `share_old_new` takes places in the new box to places in
  // the old one, both as shares of the box's sides, 0..1 inside.
  void MoveTo(const Eigen::Affine3f& share_old_new);
  // A sample in `cell` got `weight`: the score becomes the larger of that and the decayed score.
  void Record(uint32_t cell, float weight) {
    CellState& state = cells_[cell];
    const float decayed = state.score * decay_;
    state.score = weight > decayed ? weight : decayed;
    state.weight += weight;
    row_visited_[cell / kOccupancyResolution] = 1;
  }
  // A cell will be recorded soon.
  void Prefetch(uint32_t cell) const { hwy::Prefetch(cells_.data() + cell); }
  // Occupied = in the hull, and within one cell of a hull cell whose score exceeds the threshold. Allocates nothing.
  void Update();

  // The hull without the outermost layers along each axis in which rays have ended with less than `share` of all
  // weight. Behind what no view sees, such as the table an object stands on, the hull goes on to the end of the box;
  // the object does not.
  std::vector<uint8_t> TrimmedHull(double share) const;

  // What training changes, for a back end that keeps it elsewhere meanwhile.
  using LayerWeights = std::array<std::array<double, kOccupancyResolution>, 3>;
  struct State {
    std::vector<float> score;    // [kOccupancyResolution^3], x fastest
    std::vector<uint32_t> bits;  // the same cells, bit by bit: occupied
    LayerWeights layer_weight;   // of the layers along x, y, z
  };
  State state() const;
  void SetState(const State& state);

  const uint32_t* bits() const { return bits_.data(); }
  const std::vector<uint8_t>& hull() const { return hull_; }

 private:
  static constexpr size_t kRows = size_t{kOccupancyResolution} * kOccupancyResolution;
  struct CellState {
    float score;
    float weight;  // of all samples since the last Update
  };

  LayerWeights AllWeights() const;

  float decay_;
  float threshold_;
  std::vector<uint8_t> hull_;
  std::vector<uint64_t> hull_rows_;  // the hull, a bit per cell
  AlignedBuffer<CellState> cells_;
  std::array<uint8_t, kRows> row_visited_ = {};  // since the last Update
  AlignedBuffer<uint32_t> bits_;
  LayerWeights layer_weight_ = {};  // fades from Update to Update
};

}  // namespace romap::nerf
