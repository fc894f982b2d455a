#include "common/lens.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "common/status.h"

namespace romap::lens_test {

CameraModel Camera(LensModel lens, const std::array<double, 5>& distortion) {
  return {.width_px = 640,
          .height_px = 480,
          .fx_px = 400,
          .fy_px = 410,
          .cx_px = 321,
          .cy_px = 238,
          .distortion = distortion,
          .lens = lens};
}

CameraModel Barrel() { return Camera(LensModel::kRadialTangential, {-0.28, 0.09, 0.001, -0.0007, -0.01}); }
CameraModel Fisheye() { return Camera(LensModel::kFisheye, {-0.02, 0.01, -0.005, 0.001, 0}); }

std::vector<Eigen::Vector2f> PixelGrid(const CameraModel& camera) {
  std::vector<Eigen::Vector2f> pixels_px;
  for (int v = 0; v < camera.height_px; v += 13) {
    for (int u = 0; u < camera.width_px; u += 13) {
      pixels_px.emplace_back(static_cast<float>(u) + 0.3F, static_cast<float>(v) - 0.2F);
    }
  }
  return pixels_px;
}

// OpenCV's projection of the point (x, y, 1).
cv::Point2d ProjectByOpenCv(const CameraModel& camera, const Eigen::Vector3d& ray) {
  const cv::Matx33d K(camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1);
  const std::vector<cv::Point3d> points{{ray.x(), ray.y(), ray.z()}};
  const cv::Vec3d zero(0, 0, 0);
  std::vector<cv::Point2d> pixels;
  const int count = CoefficientCount(camera.lens);
  const cv::Mat k(1, count, CV_64F, const_cast<double*>(camera.distortion.data()));
  if (camera.lens == LensModel::kFisheye) {
    cv::fisheye::projectPoints(points, pixels, zero, zero, K, k);
  } else {
    cv::projectPoints(points, zero, zero, K, k, pixels);
  }
  return pixels.front();
}

class LensTest : public testing::TestWithParam<CameraModel> {};

TEST_P(LensTest, UndistortedPixelsDistortBack) {
  const CameraModel camera = GetParam();
  const std::vector<Eigen::Vector2f> distorted_px = PixelGrid(camera);
  const std::vector<Eigen::Vector2f> pinhole_px = UndistortPixels(camera, distorted_px);
  ASSERT_EQ(pinhole_px.size(), distorted_px.size());
  for (size_t i = 0; i < distorted_px.size(); ++i) {
    ASSERT_TRUE(pinhole_px[i].allFinite()) << distorted_px[i].transpose();
    const cv::Point2d again = ProjectByOpenCv(camera, camera.Unproject(pinhole_px[i].x(), pinhole_px[i].y()));
    EXPECT_NEAR(again.x, distorted_px[i].x(), 0.05);
    EXPECT_NEAR(again.y, distorted_px[i].y(), 0.05);
  }
}

TEST_P(LensTest, DistortPixelAgreesWithOpenCv) {
  const CameraModel camera = GetParam();
  for (const Eigen::Vector2f& pinhole_px : PixelGrid(camera)) {
    const cv::Point2d expected = ProjectByOpenCv(camera, camera.Unproject(pinhole_px.x(), pinhole_px.y()));
    const Eigen::Vector2d distorted_px = DistortPixel(camera, pinhole_px.cast<double>());
    EXPECT_NEAR(distorted_px.x(), expected.x, 1e-6);
    EXPECT_NEAR(distorted_px.y(), expected.y, 1e-6);
  }
}

TEST_P(LensTest, RemappedDotIsAtItsPinholePixel) {
  const CameraModel camera = GetParam();
  const Eigen::Vector2d pinhole_px(250, 310);
  const Eigen::Vector2d distorted_px = DistortPixel(camera, pinhole_px);
  ASSERT_GT((distorted_px - pinhole_px).norm(), 1);
  cv::Mat image = cv::Mat::zeros(480, 640, CV_8UC1), undistorted;
  const cv::Point center(static_cast<int>(std::lround(distorted_px.x())),
                         static_cast<int>(std::lround(distorted_px.y())));
  cv::circle(image, center, 4, 255, -1);
  const UndistortionMaps maps = MakeUndistortionMaps(camera);
  cv::remap(image, undistorted, maps.xy, maps.fraction, cv::INTER_LINEAR);
  const cv::Moments moments = cv::moments(undistorted);
  EXPECT_NEAR(moments.m10 / moments.m00, pinhole_px.x(), 0.7);
  EXPECT_NEAR(moments.m01 / moments.m00, pinhole_px.y(), 0.7);
}

INSTANTIATE_TEST_SUITE_P(Lenses, LensTest, testing::Values(Barrel(), Fisheye()),
                         [](const auto& info) { return info.index == 0 ? "RadialTangential" : "Fisheye"; });

TEST(Lens, PinholeDoesNotChangePixels) {
  const CameraModel pinhole = Barrel().Pinhole();
  EXPECT_FALSE(pinhole.HasDistortion());
  const std::vector<Eigen::Vector2f> pixels_px = PixelGrid(pinhole);
  EXPECT_EQ(UndistortPixels(pinhole, pixels_px), pixels_px);
  EXPECT_TRUE(UndistortPixels(Barrel(), {}).empty());
}

TEST(Lens, FisheyeWithoutCoefficientsHasDistortion) {
  const CameraModel camera = Camera(LensModel::kFisheye, {});
  EXPECT_TRUE(camera.HasDistortion());
  EXPECT_FALSE(camera.Pinhole().HasDistortion());
  const double theta_rad = 0.6;  // an equidistant lens projects it to f * theta
  const std::array<Eigen::Vector2f, 1> distorted_px{Eigen::Vector2f(321 + 400 * static_cast<float>(theta_rad), 238)};
  EXPECT_NEAR(UndistortPixels(camera, distorted_px).front().x(), 321 + 400 * std::tan(theta_rad), 0.01);
}

TEST(Lens, PixelsWithoutAPinholeEquivalentAreNaN) {
  CameraModel wide = Camera(LensModel::kFisheye, {});
  wide.fx_px = wide.fy_px = 150;  // rays at the corners point backward
  const std::array<Eigen::Vector2f, 2> distorted_px{Eigen::Vector2f(2, 2), Eigen::Vector2f(300, 200)};
  const std::vector<Eigen::Vector2f> pinhole_px = UndistortPixels(wide, distorted_px);
  EXPECT_FALSE(pinhole_px[0].allFinite());
  EXPECT_TRUE(pinhole_px[1].allFinite());
  // With this distortion, no ray reaches the corners.
  const CameraModel strong = Camera(LensModel::kRadialTangential, {-0.6, 0, 0, 0, 0});
  EXPECT_FALSE(UndistortPixels(strong, distorted_px)[0].allFinite());
}

TEST(Lens, ErrorsNameTheCoefficients) {
  CameraModel camera = Fisheye();
  EXPECT_TRUE(ValidateCameraModel(camera).ok());
  camera.distortion[1] = NAN;
  EXPECT_NE(Message(ValidateCameraModel(camera)).find("k1 k2 k3 k4"), std::string::npos);
  camera = Fisheye();
  camera.distortion[4] = 0.1;
  EXPECT_NE(Message(ValidateCameraModel(camera)).find("4 distortion coefficients"), std::string::npos);
}

}  // namespace romap::lens_test
