#pragma once

#include <hwy/cache_control.h>

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/nerf/math/occupancy_rules.h"
#include "server/nerf/math/types.h"
#include "server/nerf/model/aligned_buffer.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// The cells of the training box in which rays are sampled: cells of the visual hull near which samples had weight.
class Occupancy {
 public:
  explicit Occupancy(const NerfConfig& config);

  // Sets the visual hull (kOccupancyResolution^3 cells, x fastest, 1 = inside). Keeps the scores of the cells.
  void SetHull(std::vector<uint8_t> hull);
  // Resets the scores: all cells of the hull are occupied.
  void Reset();
  // Moves the grid to another box; SetHull() must follow. The score of a cell becomes the largest score of the old
  // cells it overlaps; cells outside the old box start as occupied. `T_old_new` maps points of the new box to points of
  // the old box, both in units of the box's own sides (0..1 inside).
  void MoveTo(const Eigen::Affine3f& T_old_new);
  // Records a sample of `weight` in `cell` (ScoreAfterVisit).
  void Record(uint32_t cell, float weight) {
    CellState& state = cells_[cell];
    state.score = ScoreAfterVisit(state.score, weight, decay_);
    state.weight += weight;
    row_visited_[cell / kOccupancyResolution] = 1;
  }
  // Loads a cell into the cache before Record() accesses it.
  void Prefetch(uint32_t cell) const { hwy::Prefetch(cells_.data() + cell); }
  // Recomputes the occupied cells: hull cells that are live or have a live neighbor (IsLive). Allocates nothing.
  void Update();

  // Returns the hull without the outermost layers along each axis that received less than `share` of the weight of all
  // samples. In directions that no view observes, such as toward the table below an object, the hull extends to the
  // border of the box, but the object does not.
  std::vector<uint8_t> TrimmedHull(double share) const;

  // All state that training modifies, for back ends that train on another device.
  using LayerWeights = std::array<std::array<double, kOccupancyResolution>, 3>;
  struct State {
    std::vector<float> score;    // [kOccupancyResolution^3], x fastest
    std::vector<uint32_t> bits;  // occupied cells, one bit each, same order
    LayerWeights layer_weight;   // weight of the samples in each layer along x, y, z
  };
  State state() const;
  void SetState(const State& state);

  const uint32_t* bits() const { return bits_.data(); }
  const std::vector<uint8_t>& hull() const { return hull_; }

 private:
  static constexpr size_t kRows = size_t{kOccupancyResolution} * kOccupancyResolution;
  struct CellState {
    float score;
    float weight;  // sum over the samples since the last Update
  };

  LayerWeights AllWeights() const;

  float decay_;
  float threshold_;
  std::vector<uint8_t> hull_;
  std::vector<uint64_t> hull_rows_;  // the hull, one bit per cell
  AlignedBuffer<CellState> cells_;
  std::array<uint8_t, kRows> row_visited_ = {};  // since the last Update
  AlignedBuffer<uint32_t> bits_;
  LayerWeights layer_weight_ = {};  // fades with every Update
};

}  // namespace romap::nerf
