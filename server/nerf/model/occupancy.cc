#include "server/nerf/model/occupancy.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace romap::nerf {
namespace {

constexpr int kSide = kOccupancyResolution;
static_assert(kSide == 64, "a row of cells must be one 64-bit word");

// joined[i] = rows[i] | its two neighbors at a distance of `stride` rows.
template <class Rows>
void JoinNeighbors(const Rows& rows, size_t stride, Rows& joined) {
  joined = rows;
  for (size_t i = 0; i < rows.size(); ++i) {
    const size_t along = (i / stride) % kSide;
    if (along > 0) joined[i] |= rows[i - stride];
    if (along + 1 < kSide) joined[i] |= rows[i + stride];
  }
}

}  // namespace

Occupancy::Occupancy(const NerfConfig& config)
    : decay_(static_cast<float>(config.occupancy_decay)),
      threshold_(static_cast<float>(config.occupancy_threshold)),
      hull_(kRows * kSide, 1),
      hull_rows_(kRows, ~uint64_t{0}),
      cells_(kRows * kSide),
      bits_(2 * kRows) {
  Reset();
}

void Occupancy::SetHull(std::vector<uint8_t> hull) {
  hull_ = std::move(hull);
  for (size_t row = 0; row < kRows; ++row) {
    hull_rows_[row] = 0;
    for (size_t x = 0; x < kSide; ++x) hull_rows_[row] |= uint64_t{hull_[row * kSide + x] != 0} << x;
  }
  Update();
}

void Occupancy::Reset() {
  layer_weight_ = {};
  for (size_t i = 0; i < cells_.size(); ++i) cells_[i] = {1.0f, 0.0f};
  Update();
}

void Occupancy::MoveTo(const Eigen::Affine3f& T_old_new) {
  AlignedBuffer<CellState> moved(cells_.size());
  // Probes must not be further apart than old cells, or they would miss thin surfaces.
  const float spread = T_old_new.linear().cwiseAbs().rowwise().sum().maxCoeff();
  const int probes = std::clamp(static_cast<int>(std::ceil(spread)), 1, 4);
  const Eigen::Matrix3f step = T_old_new.linear() / static_cast<float>(probes);
  const Eigen::Vector3f origin = T_old_new.translation() * kSide + step * Eigen::Vector3f::Constant(0.5f);
  for (int z = 0; z < kSide * probes; ++z) {
    for (int y = 0; y < kSide * probes; ++y) {
      const Eigen::Vector3f row = origin + step.col(1) * static_cast<float>(y) + step.col(2) * static_cast<float>(z);
      CellState* to =
          moved.data() + (static_cast<size_t>(z / probes) * kSide + static_cast<size_t>(y / probes)) * kSide;
      for (int x = 0; x < kSide * probes; ++x) {
        const Eigen::Vector3f at = row + step.col(0) * static_cast<float>(x);
        const bool inside = (at.array() >= 0).all() && (at.array() < kSide).all();
        const auto index = [&](const Eigen::Vector3i& cell) {
          return (cell.z() * kSide + cell.y()) * kSide + cell.x();
        };
        const float score = inside ? cells_[static_cast<size_t>(index(at.cast<int>()))].score : 1.0f;
        to[x / probes].score = std::max(to[x / probes].score, score);
      }
    }
  }
  cells_ = std::move(moved);
  row_visited_ = {};
  layer_weight_ = {};
}

// The faded weights plus those of the samples since the last Update.
Occupancy::LayerWeights Occupancy::AllWeights() const {
  LayerWeights all = layer_weight_;
  std::array<float, kSide> by_x = {};
  for (size_t row = 0; row < kRows; ++row) {
    if (row_visited_[row] == 0) continue;
    const CellState* cells = cells_.data() + row * kSide;
    float sum = 0;
    for (size_t x = 0; x < kSide; ++x) {
      by_x[x] += cells[x].weight;
      sum += cells[x].weight;
    }
    all[1][row % kSide] += sum;
    all[2][row / kSide] += sum;
  }
  for (size_t x = 0; x < kSide; ++x) all[0][x] += by_x[x];
  return all;
}

Occupancy::State Occupancy::state() const {
  State state{.score = {}, .bits = {bits_.span().begin(), bits_.span().end()}, .layer_weight = AllWeights()};
  state.score.reserve(cells_.size());
  for (const CellState& cell : cells_.span()) state.score.push_back(cell.score);
  return state;
}

void Occupancy::SetState(const State& state) {
  for (size_t i = 0; i < cells_.size(); ++i) cells_[i] = {state.score[i], 0.0f};
  std::ranges::copy(state.bits, bits_.data());
  row_visited_ = {};
  layer_weight_ = state.layer_weight;
}

std::vector<uint8_t> Occupancy::TrimmedHull(double share) const {
  std::array<int, 3> first, last;
  const LayerWeights weights = AllWeights();
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto& weight = weights[axis];
    const double max_cut = share * std::accumulate(weight.begin(), weight.end(), 0.0);
    first[axis] = 0;
    last[axis] = kSide - 1;
    double below = weight.front(), above = weight.back();
    while (first[axis] < kSide - 1 && below < max_cut) below += weight[static_cast<size_t>(++first[axis])];
    while (last[axis] > 0 && above < max_cut) above += weight[static_cast<size_t>(--last[axis])];
    // One layer of margin, because the surface may lie anywhere within its cell.
    first[axis] -= 1;
    last[axis] += 1;
  }
  std::vector<uint8_t> trimmed = hull_;
  for (size_t cell = 0; cell < trimmed.size(); ++cell) {
    const std::array<int, 3> at = {static_cast<int>(cell % kSide), static_cast<int>(cell / kSide % kSide),
                                   static_cast<int>(cell / (kSide * kSide))};
    for (size_t axis = 0; axis < 3; ++axis) {
      if (at[axis] < first[axis] || at[axis] > last[axis]) trimmed[cell] = 0;
    }
  }
  return trimmed;
}

void Occupancy::Update() {
  layer_weight_ = AllWeights();
  for (auto& axis : layer_weight_) {
    for (double& weight : axis) weight = FadedLayerWeight(weight);
  }
  std::array<uint64_t, kRows> live = {}, joined_y, joined_z;
  for (size_t row = 0; row < kRows; ++row) {
    CellState* cells = cells_.data() + row * kSide;
    if (row_visited_[row] != 0) {
      for (size_t x = 0; x < kSide; ++x) cells[x].weight = 0;
    }
    if (hull_rows_[row] == 0) continue;
    for (size_t x = 0; x < kSide; ++x) live[row] |= uint64_t{IsLive(cells[x].score, threshold_)} << x;
    live[row] &= hull_rows_[row];
    live[row] = WithNeighborsInRow(live[row]);
  }
  row_visited_ = {};
  JoinNeighbors(live, 1, joined_y);
  JoinNeighbors(joined_y, kSide, joined_z);
  for (size_t row = 0; row < kRows; ++row) {
    const uint64_t occupied = joined_z[row] & hull_rows_[row];
    bits_[2 * row] = static_cast<uint32_t>(occupied);
    bits_[2 * row + 1] = static_cast<uint32_t>(occupied >> 32);
  }
}

}  // namespace romap::nerf
