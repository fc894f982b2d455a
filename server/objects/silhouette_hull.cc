#include "server/objects/silhouette_hull.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace romap::objects {
namespace {

// What one silhouette shows under the cells of a grid, a row of cells at a time and in single precision: carving is the
// largest part of what objects cost. A cell on the very border of a mask may come out otherwise than by
// Silhouette::Look(); the same cell always comes out the same.
class GridLook {
 public:
  GridLook(const Silhouette& silhouette, const HullRegion& region, int cells)
      : silhouette_(silhouette),
        M_(silhouette.P_image_world.leftCols<3>() * region.R_world_grid),
        origin_(silhouette.P_image_world.leftCols<3>() * region.center_world + silhouette.P_image_world.col(3)),
        step_(M_.col(0) * (2.0 / cells * region.half_extents.x())),
        ramp_(Eigen::ArrayXf::LinSpaced(cells, 0, static_cast<float>(cells - 1))),
        seen_(static_cast<size_t>(cells)) {
    hiders_.reserve(silhouette.neighbors.size());
    for (const auto& neighbour : silhouette.neighbors) {
      hiders_.emplace_back();
      if (!neighbour) continue;
      const Eigen::Vector3d from = *neighbour * silhouette.CameraCenter();
      hiders_.back() = Hider{.from = from.cast<float>(),
                             .M = (neighbour->M * region.R_world_grid).cast<float>(),
                             .offset = (*neighbour * region.center_world - from).cast<float>()};
    }
  }

  // The mask index under each cell of the row that begins at `first_grid`; kOtherMask outside the image.
  const std::vector<uint8_t>& Row(const Eigen::Vector3d& first_grid) {
    constexpr double kLeastDepth = 1e-9;
    const Eigen::Vector3d first = origin_ + M_ * first_grid;
    const double last_z = first.z() + static_cast<double>(seen_.size() - 1) * step_.z();
    if (!(std::min(first.z(), last_z) > kLeastDepth)) {
      LookCellByCell(first);
      return seen_;
    }
    const cv::Mat& image = silhouette_.masks->framed;
    const Eigen::Vector3f q = first.cast<float>();
    const Eigen::Vector3f step = step_.cast<float>();
    inverse_z_ = (q.z() + ramp_ * step.z()).inverse();
    // The border of the framed image stands for all that is outside; 1.5 = the border and half a pixel.
    u_ = ((q.x() + ramp_ * step.x()) * inverse_z_ + 1.5F).max(0.0F).min(static_cast<float>(image.cols - 1)).cast<int>();
    v_ = ((q.y() + ramp_ * step.y()) * inverse_z_ + 1.5F).max(0.0F).min(static_cast<float>(image.rows - 1)).cast<int>();
    offset_ = v_ * static_cast<int>(image.step) + u_;
    for (size_t x = 0; x < seen_.size(); ++x) seen_[x] = image.data[offset_[static_cast<Eigen::Index>(x)]];
    return seen_;
  }

  // Silhouette::MayHide() for a point of the grid.
  bool MayHide(uint8_t seen, const Eigen::Vector3f& p_grid) const {
    const size_t neighbour = static_cast<size_t>(seen) - 1;
    if (neighbour >= hiders_.size() || !hiders_[neighbour]) return true;
    const Hider& hider = *hiders_[neighbour];
    const Eigen::Array3f inverse_step = (hider.M * p_grid + hider.offset).array().inverse();
    const Eigen::Array3f t0 = (-1 - hider.from.array()) * inverse_step;
    const Eigen::Array3f t1 = (1 - hider.from.array()) * inverse_step;
    const float near = t0.min(t1).maxCoeff();
    const float far = t0.max(t1).minCoeff();
    return near <= far && far >= 0 && near <= 1;
  }

 private:
  // A neighbour's box, as the map of the grid to its unit cube, less the camera's place in there.
  struct Hider {
    Eigen::Vector3f from;
    Eigen::Matrix3f M;
    Eigen::Vector3f offset;
  };

  void LookCellByCell(Eigen::Vector3d q) {
    for (uint8_t& seen : seen_) {
      const int value = silhouette_.IndexAt(q);
      seen = value < 0 ? kOtherMask : static_cast<uint8_t>(value);
      q += step_;
    }
  }

  const Silhouette& silhouette_;
  Eigen::Matrix3d M_;
  Eigen::Vector3d origin_;
  Eigen::Vector3d step_;
  Eigen::ArrayXf ramp_;
  Eigen::ArrayXf inverse_z_;
  Eigen::ArrayXi u_, v_, offset_;
  std::vector<uint8_t> seen_;
  std::vector<std::optional<Hider>> hiders_;
};

}  // namespace

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
  GridLook look(silhouette, region_, cells_);
  int16_t* inside = inside_.data();
  int16_t* outside = outside_.data();
  for (int z = 0; z < cells_; ++z) {
    for (int y = 0; y < cells_; ++y) {
      int x = 0;
      for (const uint8_t seen : look.Row(CellCenter(0, y, z))) {
        if (seen == silhouette.index) {
          *inside = static_cast<int16_t>(*inside + weight);
        } else if (seen == 0 || !look.MayHide(seen, CellCenter(x, y, z).cast<float>())) {
          *outside = static_cast<int16_t>(*outside + weight);
        }
        ++x;
        ++inside;
        ++outside;
      }
    }
  }
}

Eigen::AlignedBox3d SilhouetteHull::Bounds(const HullVotes& votes) const {
  Eigen::AlignedBox3i passed;
  size_t index = 0;
  for (int z = 0; z < cells_; ++z) {
    for (int y = 0; y < cells_; ++y) {
      for (int x = 0; x < cells_; ++x, ++index) {
        if (Passes(index, votes)) passed.extend(Eigen::Vector3i(x, y, z));
      }
    }
  }
  if (passed.isEmpty()) return {};
  const Eigen::Vector3i& low = passed.min();
  const Eigen::Vector3i& high = passed.max();
  return {CellCenter(low.x(), low.y(), low.z()) - CellSize() / 2,
          CellCenter(high.x(), high.y(), high.z()) + CellSize() / 2};
}

std::vector<Eigen::Vector3d> SilhouetteHull::Cells(const HullVotes& votes) const {
  std::vector<Eigen::Vector3d> centers;
  size_t index = 0;
  for (int z = 0; z < cells_; ++z) {
    for (int y = 0; y < cells_; ++y) {
      for (int x = 0; x < cells_; ++x, ++index) {
        if (Passes(index, votes)) centers.push_back(CellCenter(x, y, z));
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
  return Passes(index, votes);
}

}  // namespace romap::objects
