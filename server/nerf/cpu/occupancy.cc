#include "server/nerf/cpu/occupancy.h"

#include <utility>

namespace romap::nerf {
namespace {

constexpr int kSide = kOccupancyResolution;
constexpr size_t kRows = size_t{kSide} * kSide;
static_assert(kSide == 64, "a row of cells must be one 64-bit word");

// Joins each row with its two neighbours `stride` rows apart.
std::vector<uint64_t> JoinNeighbours(const std::vector<uint64_t>& rows, size_t stride) {
  std::vector<uint64_t> joined = rows;
  for (size_t i = 0; i < kRows; ++i) {
    const size_t along = (i / stride) % kSide;
    if (along > 0) joined[i] |= rows[i - stride];
    if (along + 1 < kSide) joined[i] |= rows[i + stride];
  }
  return joined;
}

}  // namespace

Occupancy::Occupancy(const NerfConfig& config)
    : decay_(static_cast<float>(config.occupancy_decay)),
      threshold_(static_cast<float>(config.occupancy_threshold)),
      hull_(kRows * kSide, 1),
      score_(kRows * kSide),
      bits_(2 * kRows) {
  Reset();
}

void Occupancy::SetHull(std::vector<uint8_t> hull) {
  hull_ = std::move(hull);
  Update();
}

void Occupancy::Reset() {
  for (size_t i = 0; i < score_.size(); ++i) score_[i] = 1.0f;
  Update();
}

void Occupancy::Update() {
  std::vector<uint64_t> in_hull(kRows), live(kRows);
  for (size_t row = 0; row < kRows; ++row) {
    for (int x = 0; x < kSide; ++x) {
      const size_t cell = row * kSide + static_cast<size_t>(x);
      in_hull[row] |= uint64_t{hull_[cell]} << x;
      live[row] |= uint64_t{hull_[cell] != 0 && score_[cell] > threshold_} << x;
    }
    live[row] |= (live[row] << 1) | (live[row] >> 1);
  }
  live = JoinNeighbours(JoinNeighbours(live, 1), kSide);
  for (size_t row = 0; row < kRows; ++row) {
    const uint64_t occupied = live[row] & in_hull[row];
    bits_[2 * row] = static_cast<uint32_t>(occupied);
    bits_[2 * row + 1] = static_cast<uint32_t>(occupied >> 32);
  }
}

}  // namespace romap::nerf
