#include "common/lens.h"

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

namespace romap {
namespace {

constexpr double kAccuracy_px = 0.05;
// OpenCV inverts the radial-tangential formula by fixed-point iteration, which converges slowly for strong distortion.
constexpr int kIterations = 100;
constexpr double kConverged_px = 0.001;

cv::Matx33d IntrinsicMatrix(const CameraModel& camera) {
  return {camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1};
}

cv::Mat Coefficients(const CameraModel& camera) {
  return cv::Mat(1, CoefficientCount(camera.lens), CV_64F, const_cast<double*>(camera.distortion.data())).clone();
}

// Image-plane coordinates (z = 1) with distortion, from those without.
Eigen::Vector2d DistortRadialTangential(const std::array<double, 5>& k, const Eigen::Vector2d& ray) {
  const double x = ray.x(), y = ray.y(), r2 = ray.squaredNorm();
  const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  return {x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
          y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y};
}

Eigen::Vector2d DistortFisheye(const std::array<double, 5>& k, const Eigen::Vector2d& ray) {
  const double r = ray.norm();
  if (r == 0) return ray;
  const double theta = std::atan(r), t2 = theta * theta;
  return ray * (theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / r);
}

}  // namespace

std::vector<Eigen::Vector2f> UndistortPixels(const CameraModel& camera, std::span<const Eigen::Vector2f> pixels_px) {
  std::vector<Eigen::Vector2f> undistorted(pixels_px.begin(), pixels_px.end());
  if (pixels_px.empty() || !camera.HasDistortion()) return undistorted;
  std::vector<cv::Point2d> distorted, undistorted_points;
  for (const Eigen::Vector2f& pixel_px : pixels_px) distorted.emplace_back(pixel_px.x(), pixel_px.y());
  const cv::Matx33d K = IntrinsicMatrix(camera);
  const cv::TermCriteria until(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, kIterations,
                               camera.lens == LensModel::kFisheye ? 1e-9 : kConverged_px);
  if (camera.lens == LensModel::kFisheye) {
    cv::fisheye::undistortPoints(distorted, undistorted_points, K, Coefficients(camera), cv::noArray(), K, until);
  } else {
    cv::undistortPoints(distorted, undistorted_points, K, Coefficients(camera), cv::noArray(), K, until);
  }
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  for (size_t i = 0; i < undistorted_points.size(); ++i) {
    // OpenCV does not report whether the iteration converged.
    const Eigen::Vector2d pinhole_px(undistorted_points[i].x, undistorted_points[i].y);
    const double error_px = (DistortPixel(camera, pinhole_px) - pixels_px[i].cast<double>()).norm();
    undistorted[i] = error_px < kAccuracy_px ? pinhole_px.cast<float>().eval() : Eigen::Vector2f(kNone, kNone);
  }
  return undistorted;
}

Eigen::Vector2d DistortPixel(const CameraModel& camera, const Eigen::Vector2d& pinhole_px) {
  const Eigen::Vector2d ray = camera.Unproject(pinhole_px.x(), pinhole_px.y()).head<2>();
  const Eigen::Vector2d distorted = camera.lens == LensModel::kFisheye
                                        ? DistortFisheye(camera.distortion, ray)
                                        : DistortRadialTangential(camera.distortion, ray);
  return camera.Project({distorted.x(), distorted.y(), 1});
}

Eigen::Vector2d ProjectDistorted(const CameraModel& camera, const Eigen::Vector3d& p_camera) {
  const Eigen::Vector2d pinhole_px = camera.Project(p_camera);
  return camera.HasDistortion() ? DistortPixel(camera, pinhole_px) : pinhole_px;
}

UndistortionMaps MakeUndistortionMaps(const CameraModel& camera) {
  UndistortionMaps maps;
  const cv::Matx33d K = IntrinsicMatrix(camera);
  const cv::Size size(camera.width_px, camera.height_px);
  if (camera.lens == LensModel::kFisheye) {
    cv::fisheye::initUndistortRectifyMap(K, Coefficients(camera), cv::Matx33d::eye(), K, size, CV_16SC2, maps.xy,
                                         maps.fraction);
  } else {
    cv::initUndistortRectifyMap(K, Coefficients(camera), cv::noArray(), K, size, CV_16SC2, maps.xy, maps.fraction);
  }
  return maps;
}

}  // namespace romap
