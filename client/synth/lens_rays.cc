#include "client/synth/lens_rays.h"

#include <Eigen/LU>
#include <limits>

#include "client/render/rasterizer.h"
#include "common/lens.h"
#include "common/parallel_for.h"

namespace romap::synth {
namespace {

// Refines an undistorted pixel by Newton's method on the exact distortion formula, from an initial value within a
// fraction of a pixel. Rendering must not share the approximation error of the undistortion that is tested with it.
Eigen::Vector2d Refine(const CameraModel& camera, const Eigen::Vector2d& pixel_px, Eigen::Vector2d pinhole_px) {
  constexpr double kStep_px = 1e-3;
  constexpr double kTolerance_px = 1e-7;
  for (int iteration = 0; iteration < 8; ++iteration) {
    const Eigen::Vector2d error_px = DistortPixel(camera, pinhole_px) - pixel_px;
    if (error_px.norm() < kTolerance_px) break;
    Eigen::Matrix2d slope;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d step_px = kStep_px * Eigen::Vector2d::Unit(k);
      slope.col(k) =
          (DistortPixel(camera, pinhole_px + step_px) - DistortPixel(camera, pinhole_px - step_px)) / (2 * kStep_px);
    }
    pinhole_px -= slope.inverse() * error_px;
  }
  return pinhole_px;
}

}  // namespace

std::vector<Eigen::Vector2d> LensRays(const CameraModel& camera, int samples_across) {
  constexpr double kTolerance_px = 1e-6;
  const CameraModel fine = render::Supersampled(camera, samples_across);
  std::vector<Eigen::Vector2d> rays(static_cast<size_t>(fine.width_px) * static_cast<size_t>(fine.height_px));
  ParallelFor(fine.height_px, [&](int v) {
    std::vector<Eigen::Vector2f> pixels_px;
    for (int u = 0; u < fine.width_px; ++u) pixels_px.emplace_back(u, v);
    const std::vector<Eigen::Vector2f> starts_px = UndistortPixels(fine, pixels_px);
    for (int u = 0; u < fine.width_px; ++u) {
      const Eigen::Vector2d pixel_px(u, v);
      const Eigen::Vector2d pinhole_px = Refine(fine, pixel_px, starts_px[static_cast<size_t>(u)].cast<double>());
      const bool found = (DistortPixel(fine, pinhole_px) - pixel_px).norm() < kTolerance_px;  // false for NaN
      rays[static_cast<size_t>(v) * static_cast<size_t>(fine.width_px) + static_cast<size_t>(u)] =
          found ? fine.Unproject(pinhole_px.x(), pinhole_px.y()).head<2>()
                : Eigen::Vector2d(Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
  });
  return rays;
}

}  // namespace romap::synth
