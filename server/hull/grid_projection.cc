#include "server/hull/grid_projection.h"

#include <algorithm>

namespace romap::hull {

GridProjection GridProjection::Of(const CameraModel& camera, const Eigen::Matrix3d& R_camera_grid,
                                  const Eigen::Vector3d& t_camera_grid) {
  const Eigen::Matrix3d K{{camera.fx_px, 0, camera.cx_px}, {0, camera.fy_px, camera.cy_px}, {0, 0, 1}};
  return {K * R_camera_grid, K * t_camera_grid};
}

RowProjector::RowProjector(const GridProjection& projection, const VoxelGrid& grid)
    : projection_(projection),
      grid_(grid),
      first_(Eigen::Vector3d::Zero()),
      step_(projection.M.col(0) * (2.0 / grid.cells * grid.half_extents.x())),
      x_(Eigen::ArrayXf::LinSpaced(grid.cells, 0, static_cast<float>(grid.cells - 1))) {}

bool RowProjector::Project(int y, int z) {
  constexpr double kMinDepth = 1e-9;
  first_ = projection_ * grid_.CellCenter(0, y, z);
  const double last_z = first_.z() + static_cast<double>(grid_.cells - 1) * step_.z();
  if (!(std::min(first_.z(), last_z) > kMinDepth)) return false;
  const Eigen::Vector3f q = first_.cast<float>();
  const Eigen::Vector3f step = step_.cast<float>();
  inverse_z_ = (q.z() + x_ * step.z()).inverse();
  u_px_ = (q.x() + x_ * step.x()) * inverse_z_;
  v_px_ = (q.y() + x_ * step.y()) * inverse_z_;
  return true;
}

}  // namespace romap::hull
