#include "server/hull/evidence_grid.h"

#include <algorithm>
#include <optional>

namespace romap::hull {

void EvidenceGrid::Reset(const VoxelGrid& grid) {
  grid_ = grid;
  for (std::vector<uint8_t>& views : views_) views.assign(grid.size(), 0);
}

void EvidenceGrid::Count(size_t first_cell, std::span<const CellEvidence> evidence, int sign) {
  std::array<uint8_t*, 4> views;
  for (size_t kind = 0; kind < views.size(); ++kind) views[kind] = &views_[kind][first_cell];
  for (size_t i = 0; i < evidence.size(); ++i) {
    if (evidence[i] == CellEvidence::kNone) continue;
    uint8_t& count = views[static_cast<size_t>(evidence[i])][i];
    count = static_cast<uint8_t>(count + sign);
  }
}

void EvidenceGrid::Count(size_t first_cell, size_t cells, CellEvidence evidence, int sign) {
  if (evidence == CellEvidence::kNone) return;
  uint8_t* views = &views_[static_cast<size_t>(evidence)][first_cell];
  for (size_t i = 0; i < cells; ++i) views[i] = static_cast<uint8_t>(views[i] + sign);
}

bool EvidenceGrid::Keeps(size_t cell, const CarvingRule& rule) const {
  const int object = Views(cell, CellEvidence::kObject);
  const int background = Views(cell, CellEvidence::kBackground);
  const int in_crop = object + background + Views(cell, CellEvidence::kOccluded);
  const int in_image = in_crop + Views(cell, CellEvidence::kCropped);
  return background < std::max<double>(rule.min_background, rule.background_share * in_crop) &&
         object >= std::max<double>(rule.min_object, rule.object_share * in_image);
}

std::vector<uint8_t> EvidenceGrid::Carve(const CarvingRule& rule) const {
  std::vector<uint8_t> kept(grid_.size());
  for (size_t cell = 0; cell < kept.size(); ++cell) kept[cell] = Keeps(cell, rule) ? 1 : 0;
  return kept;
}

template <class Visit>
void EvidenceGrid::ForEachKept(const CarvingRule& rule, Visit visit) const {
  size_t cell = 0;
  for (int z = 0; z < grid_.cells; ++z) {
    for (int y = 0; y < grid_.cells; ++y) {
      for (int x = 0; x < grid_.cells; ++x, ++cell) {
        if (Keeps(cell, rule)) visit(x, y, z);
      }
    }
  }
}

std::vector<Eigen::Vector3d> EvidenceGrid::Cells(const CarvingRule& rule) const {
  std::vector<Eigen::Vector3d> centers;
  ForEachKept(rule, [&](int x, int y, int z) { centers.push_back(grid_.CellCenter(x, y, z)); });
  return centers;
}

Eigen::AlignedBox3d EvidenceGrid::Bounds(const CarvingRule& rule) const {
  Eigen::AlignedBox3i kept;
  ForEachKept(rule, [&](int x, int y, int z) { kept.extend(Eigen::Vector3i(x, y, z)); });
  if (kept.isEmpty()) return {};
  const Eigen::Vector3i& low = kept.min();
  const Eigen::Vector3i& high = kept.max();
  return {grid_.CellCenter(low.x(), low.y(), low.z()) - grid_.CellSize() / 2,
          grid_.CellCenter(high.x(), high.y(), high.z()) + grid_.CellSize() / 2};
}

bool EvidenceGrid::Contains(const Eigen::Vector3d& p_grid, const CarvingRule& rule) const {
  const std::optional<size_t> cell = grid_.CellAt(p_grid);
  return cell && Keeps(*cell, rule);
}

}  // namespace romap::hull
