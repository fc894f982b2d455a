#include "server/objects/silhouette_hull.h"

#include <cmath>

namespace romap {

void SilhouetteHull::Reset(const HullRegion& region, int cells) {
  region_ = region;
  cells_ = cells;
  const auto count = static_cast<size_t>(cells) * static_cast<size_t>(cells) * static_cast<size_t>(cells);
  inside_.assign(count, 0);
  outside_.assign(count, 0);
}

void SilhouetteHull::Move(const Sim3<World, World>& S_new_old) {
  region_.R_world_grid = S_new_old.rotation() * region_.R_world_grid;
  region_.center_world = S_new_old * region_.center_world;
  region_.half_extents *= S_new_old.scale();
}

void SilhouetteHull::Vote(const Silhouette& silhouette, int weight) {
  const Eigen::Matrix3d M = silhouette.P_image_world.leftCols<3>() * region_.R_world_grid;
  const Eigen::Vector3d origin =
      silhouette.P_image_world.leftCols<3>() * region_.center_world + silhouette.P_image_world.col(3);
  const Eigen::Vector3d step_x = M.col(0) * CellSize().x();
  size_t index = 0;
  for (int z = 0; z < cells_; ++z) {
    for (int y = 0; y < cells_; ++y) {
      Eigen::Vector3d q = origin + M * CellCenter(0, y, z);
      for (int x = 0; x < cells_; ++x, ++index, q += step_x) {
        const MaskHit hit =
            silhouette.Judge(silhouette.SeenAt(q), [&] { return region_.ToWorld(CellCenter(x, y, z)); });
        if (hit == MaskHit::kInside) inside_[index] = static_cast<int16_t>(inside_[index] + weight);
        if (hit == MaskHit::kOutside) outside_[index] = static_cast<int16_t>(outside_[index] + weight);
      }
    }
  }
}

std::vector<Eigen::Vector3d> SilhouetteHull::Cells(const HullVotes& votes) const {
  std::vector<Eigen::Vector3d> centers;
  size_t index = 0;
  for (int z = 0; z < cells_; ++z) {
    for (int y = 0; y < cells_; ++y) {
      for (int x = 0; x < cells_; ++x, ++index) {
        if (outside_[index] > votes.max_outside || inside_[index] < votes.min_inside) continue;
        centers.push_back(CellCenter(x, y, z));
      }
    }
  }
  return centers;
}

bool SilhouetteHull::Contains(const Eigen::Vector3d& p_grid, const HullVotes& votes) const {
  if (empty()) return false;
  size_t index = 0;
  for (int axis = 2; axis >= 0; --axis) {
    const double cell = std::floor((p_grid[axis] / region_.half_extents[axis] + 1) / 2 * cells_);
    if (!(cell >= 0 && cell < cells_)) return false;
    index = index * static_cast<size_t>(cells_) + static_cast<size_t>(cell);
  }
  return outside_[index] <= votes.max_outside && inside_[index] >= votes.min_inside;
}

}  // namespace romap
