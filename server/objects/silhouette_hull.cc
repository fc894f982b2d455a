#include "server/objects/silhouette_hull.h"

#include <cstdint>
#include <optional>

#include "server/hull/grid_projection.h"

namespace romap::objects {
namespace {

using hull::CellEvidence;

// The evidence of one silhouette for the cells of a grid, a row at a time, in single precision. A cell whose center
// projects to the border of a mask may differ from Silhouette::IndexAt(), but always in the same way.
class RowEvidence {
 public:
  RowEvidence(const Silhouette& silhouette, const HullRegion& region, const hull::VoxelGrid& grid)
      : silhouette_(silhouette),
        grid_(grid),
        projector_({silhouette.P_image_world.leftCols<3>() * region.R_world_grid,
                    silhouette.P_image_world.leftCols<3>() * region.center_world + silhouette.P_image_world.col(3)},
                   grid),
        masks_(static_cast<size_t>(grid.cells)),
        evidence_(static_cast<size_t>(grid.cells)) {
    occluders_.reserve(silhouette.neighbors.size());
    for (const auto& neighbor : silhouette.neighbors) {
      occluders_.emplace_back();
      if (!neighbor) continue;
      const Eigen::Vector3d from = *neighbor * silhouette.CameraCenter();
      occluders_.back() = Occluder{.from = from.cast<float>(),
                                   .M = (neighbor->M * region.R_world_grid).cast<float>(),
                                   .offset = (*neighbor * region.center_world - from).cast<float>()};
    }
  }

  const std::vector<CellEvidence>& At(int y, int z) {
    if (projector_.Project(y, z)) {
      ReadMasks();
    } else {
      ReadMasksCellByCell();
    }
    for (int x = 0; x < grid_.cells; ++x) {
      const uint8_t mask = masks_[static_cast<size_t>(x)];
      CellEvidence evidence = CellEvidence::kNone;
      if (mask == silhouette_.index) {
        evidence = CellEvidence::kObject;
      } else if (mask == 0 || !MayOcclude(mask, grid_.CellCenter(x, y, z).cast<float>())) {
        evidence = CellEvidence::kBackground;
      }
      evidence_[static_cast<size_t>(x)] = evidence;
    }
    return evidence_;
  }

 private:
  // A neighbor's box as the map from the grid to its unit cube, relative to the camera center in that cube.
  struct Occluder {
    Eigen::Vector3f from;  // camera center in the unit cube
    Eigen::Matrix3f M;
    Eigen::Vector3f offset;
  };

  // Sets masks_ to the mask index under each cell of the projected row, kOtherMask outside the image.
  void ReadMasks() {
    const cv::Mat& image = silhouette_.masks->padded;
    // Pixels outside the image are clamped to its one-pixel border of kOtherMask; 1.5 = the border and half a pixel.
    u_ = (projector_.u_px() + 1.5F).max(0.0F).min(static_cast<float>(image.cols - 1)).cast<int>();
    v_ = (projector_.v_px() + 1.5F).max(0.0F).min(static_cast<float>(image.rows - 1)).cast<int>();
    offset_ = v_ * static_cast<int>(image.step) + u_;
    for (size_t x = 0; x < masks_.size(); ++x) masks_[x] = image.data[offset_[static_cast<Eigen::Index>(x)]];
  }

  void ReadMasksCellByCell() {
    Eigen::Vector3d q = projector_.first();
    for (uint8_t& mask : masks_) {
      const int value = silhouette_.IndexAt(q);
      mask = value < 0 ? kOtherMask : static_cast<uint8_t>(value);
      q += projector_.step();
    }
  }

  // Silhouette::MayOcclude() for a point of the grid.
  bool MayOcclude(uint8_t mask, const Eigen::Vector3f& p_grid) const {
    const size_t neighbor = static_cast<size_t>(mask) - 1;
    if (neighbor >= occluders_.size() || !occluders_[neighbor]) return true;
    const Occluder& occluder = *occluders_[neighbor];
    const Eigen::Array3f inverse_step = (occluder.M * p_grid + occluder.offset).array().inverse();
    const Eigen::Array3f t0 = (-1 - occluder.from.array()) * inverse_step;
    const Eigen::Array3f t1 = (1 - occluder.from.array()) * inverse_step;
    const float near = t0.min(t1).maxCoeff();
    const float far = t0.max(t1).minCoeff();
    return near <= far && far >= 0 && near <= 1;
  }

  const Silhouette& silhouette_;
  const hull::VoxelGrid& grid_;
  hull::RowProjector projector_;
  Eigen::ArrayXi u_, v_, offset_;
  std::vector<uint8_t> masks_;
  std::vector<CellEvidence> evidence_;
  std::vector<std::optional<Occluder>> occluders_;
};

}  // namespace

void SilhouetteHull::Reset(const HullRegion& region, int cells) {
  region_ = region;
  evidence_.Reset({region.half_extents, cells});
}

void SilhouetteHull::Move(const Sim3<World, World>& S_new_old) {
  region_.R_world_grid = S_new_old.rotation() * region_.R_world_grid;
  region_.center_world = S_new_old * region_.center_world;
  region_.half_extents *= S_new_old.scale();
  evidence_.Scale(S_new_old.scale());
}

void SilhouetteHull::Count(const Silhouette& silhouette, int sign) {
  const hull::VoxelGrid& grid = evidence_.grid();
  RowEvidence rows(silhouette, region_, grid);
  for (int z = 0; z < grid.cells; ++z) {
    for (int y = 0; y < grid.cells; ++y) evidence_.Count(grid.Index(0, y, z), rows.At(y, z), sign);
  }
}

}  // namespace romap::objects
