#pragma once

#include <Eigen/Core>

#include "common/camera_model.h"
#include "server/hull/voxel_grid.h"

namespace romap::hull {

// Pinhole projection of points of a grid's frame: q = M * p + offset is (u z, v z, z) with the pixel coordinates u, v
// and the depth z along the optical axis.
struct GridProjection {
  Eigen::Matrix3d M;
  Eigen::Vector3d offset;

  // Projection of a camera without distortion whose pose is p_camera = R_camera_grid * p_grid + t_camera_grid.
  static GridProjection Of(const CameraModel& camera, const Eigen::Matrix3d& R_camera_grid,
                           const Eigen::Vector3d& t_camera_grid);

  Eigen::Vector3d operator*(const Eigen::Vector3d& p_grid) const { return M * p_grid + offset; }
};

// The pixels under the centers of one row of cells (along x). Projecting every cell of a grid into every view dominates
// the cost of carving, so the arithmetic is in single precision and vectorized over the row. Rounding may move a
// center near a pixel border to the neighboring pixel, but the result is deterministic.
class RowProjector {
 public:
  RowProjector(const GridProjection& projection, const VoxelGrid& grid);

  // False if some cell center of the row is not in front of the camera; then u_px() and v_px() are not set.
  bool Project(int y, int z);

  // Pixel coordinates of the last row, by x.
  const Eigen::ArrayXf& u_px() const { return u_px_; }
  const Eigen::ArrayXf& v_px() const { return v_px_; }
  // Projection of the last row's first cell (see GridProjection), and the step from a cell to the next.
  const Eigen::Vector3d& first() const { return first_; }
  const Eigen::Vector3d& step() const { return step_; }

 private:
  GridProjection projection_;
  VoxelGrid grid_;
  Eigen::Vector3d first_;
  Eigen::Vector3d step_;
  Eigen::ArrayXf x_;  // 0, 1, .. cells - 1
  Eigen::ArrayXf inverse_z_, u_px_, v_px_;
};

}  // namespace romap::hull
