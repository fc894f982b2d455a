#include "client/synth/frame_renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "client/synth/lens_rays.h"
#include "client/synth/lighting.h"
#include "client/synth/solid.h"
#include "client/synth/synth_camera.h"

namespace romap::synth::frame_renderer_test {

// The pixel of a ray (x, y, 1) by the distortion formulas in OpenCV's documentation.
Eigen::Vector2d PixelByTheBook(const CameraModel& camera, double x, double y) {
  const auto& k = camera.distortion;
  const double r2 = x * x + y * y;
  Eigen::Vector2d bent;
  if (camera.lens == LensModel::kFisheye) {
    const double r = std::sqrt(r2);
    const double t = std::atan(r);
    const double t2 = t * t;
    const double bent_t = t * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
    bent = (r > 0 ? bent_t / r : 1) * Eigen::Vector2d(x, y);
  } else {
    const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    bent = {x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
            y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y};
  }
  return {camera.fx_px * bent.x() + camera.cx_px, camera.fy_px * bent.y() + camera.cy_px};
}

TEST(LensRaysTest, InvertTheLensExactly) {
  for (const SynthLens lens : {SynthLens::kRadialTangential, SynthLens::kFisheye}) {
    const CameraModel camera = SynthCamera({.width_px = 160, .height_px = 120, .lens = lens});
    for (const int across : {1, 2}) {
      const auto rays = LensRays(camera, across);
      ASSERT_EQ(rays.size(), 160U * 120U * static_cast<size_t>(across * across));
      for (int v = 0; v < 120 * across; ++v) {
        for (int u = 0; u < 160 * across; ++u) {
          const Eigen::Vector2d& ray = rays[static_cast<size_t>(v * 160 * across + u)];
          // Sample (u, v) in pixel coordinates of the original image.
          const Eigen::Vector2d pixel_px((u + 0.5) / across - 0.5, (v + 0.5) / across - 0.5);
          ASSERT_LT((PixelByTheBook(camera, ray.x(), ray.y()) - pixel_px).norm(), 1e-4) << u << ' ' << v;
        }
      }
    }
  }
}

// A checkered ball in front of a checkered wall.
Scene BallScene() {
  Scene scene;
  Random random(5);
  AddSurface(scene, RoundedBox(Point(0, 0, -0.5F), Point(2, 2, 0.05F), 0.01F, 0.1F), {},
             RandomMaterial(Pattern::kChecks, 0.1F, random), 0);
  AddSurface(scene, Ellipsoid(Point(0.05F, 0.02F, 0.2F), Point(0.2F, 0.15F, 0.2F)), {},
             RandomMaterial(Pattern::kChecks, 0.05F, random), 1);
  scene.lights = {{Point(0, 0.5F, 2), Point(0.2F, 0, 0), Point(0, 0.2F, 0), Rgb::Constant(2)}};
  BakeLight(scene);
  return scene;
}

// A camera above the scene, pointing down.
SE3<World, Camera> Above() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(3.14159265, Eigen::Vector3d::UnitX())), Eigen::Vector3d(0.1, 0, 1.2)};
}

TEST(FrameRendererTest, WeakDistortionRendersLikeAPinhole) {
  const Scene scene = BallScene();
  CameraModel camera = SynthCamera({.width_px = 160, .height_px = 120});
  const TrueFrame pinhole = FrameRenderer(scene, camera).Render(ImagePoses(Above()));
  camera.distortion[0] = 1e-9;  // enables ray tracing
  const TrueFrame lens = FrameRenderer(scene, camera).Render(ImagePoses(Above()));
  EXPECT_GT(cv::countNonZero(pinhole.labels), 1000);
  EXPECT_LE(cv::countNonZero(pinhole.labels != lens.labels), 4) << "ties at edges";
  EXPECT_LE(cv::countNonZero(cv::abs(pinhole.depth_m - lens.depth_m) > 1e-3), 4);
  cv::Mat difference;
  cv::absdiff(pinhole.color_bgr, lens.color_bgr, difference);
  EXPECT_LE(cv::countNonZero(difference.reshape(1) > 8), 60);
}

TEST(FrameRendererTest, LensDistortsColorMaskAndDepthAlike) {
  const Scene scene = BallScene();
  for (const SynthLens lens : {SynthLens::kRadialTangential, SynthLens::kFisheye}) {
    const CameraModel camera = SynthCamera({.width_px = 320, .height_px = 240, .lens = lens});
    const TrueFrame frame = FrameRenderer(scene, camera).Render(ImagePoses(Above()));
    // The top of the wall is at z = -0.45, at a depth of 1.65 m for every pixel.
    int wall_pixels = 0;
    for (int v = 0; v < 240; v += 7) {
      for (int u = 0; u < 320; u += 7) {
        if (frame.labels.at<uint8_t>(v, u) != 0 || frame.depth_m.at<float>(v, u) == 0) continue;
        ++wall_pixels;
        EXPECT_NEAR(frame.depth_m.at<float>(v, u), 1.65, 2e-3) << u << ' ' << v;
      }
    }
    EXPECT_GT(wall_pixels, 300);
    // The nearest point of the ball is at (0.05, 0.02, 0.4), at a depth of 0.8 m.
    const Eigen::Vector3d top = Above().Inverse() * Eigen::Vector3d(0.05, 0.02, 0.4);
    const Eigen::Vector2d pixel_px = PixelByTheBook(camera, top.x() / top.z(), top.y() / top.z());
    const int u = static_cast<int>(std::lround(pixel_px.x()));
    const int v = static_cast<int>(std::lround(pixel_px.y()));
    EXPECT_EQ(frame.labels.at<uint8_t>(v, u), 1);
    EXPECT_NEAR(frame.depth_m.at<float>(v, u), 0.8, 2e-3);
  }
}

// Poses with the given rotation of the camera about its vertical axis and a fixed position.
SE3<World, Camera> AboveTurned(double yaw_rad) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitY()));
  return {Above().rotation() * turn, Above().translation()};
}

TEST(FrameRendererTest, RowsOfARollingShutterAreRowsOfStillImages) {
  const Scene scene = BallScene();
  for (const SynthLens lens : {SynthLens::kPinhole, SynthLens::kRadialTangential}) {
    const CameraModel camera = SynthCamera({.width_px = 160, .height_px = 120, .lens = lens});
    const FrameRenderer renderer(scene, camera);
    std::vector<SE3<World, Camera>> rows;
    for (int v = 0; v < 120; ++v) rows.push_back(AboveTurned(0.1 * (v / 119.0 - 0.5)));
    const TrueFrame rolling = renderer.Render(ImagePoses(camera, rows));
    for (const int v : {10, 40, 59, 100}) {
      const TrueFrame still = renderer.Render(ImagePoses(rows[static_cast<size_t>(v)]));
      EXPECT_LE(cv::countNonZero(rolling.labels.row(v) != still.labels.row(v)), 1) << v;
      EXPECT_LE(cv::countNonZero(cv::abs(rolling.depth_m.row(v) - still.depth_m.row(v)) > 2e-3), 2) << v;
      cv::Mat difference;
      cv::absdiff(rolling.color_bgr.row(v), still.color_bgr.row(v), difference);
      EXPECT_LE(cv::countNonZero(difference.reshape(1) > 16), 16) << v << ", pixels at edges";
    }
    const TrueFrame middle = renderer.Render(ImagePoses(AboveTurned(0)));
    EXPECT_GT(cv::countNonZero(rolling.labels != middle.labels), 25) << "the shape of the ball is skewed";
  }
}

// CV_32FC3, linear intensity 0..1.
cv::Mat Linear(const cv::Mat& color_bgr) {
  cv::Mat linear;
  color_bgr.convertTo(linear, CV_32F, 1.0 / 255);
  cv::pow(linear, 2.2, linear);
  return linear;
}

double RootMeanSquare(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b) / std::sqrt(static_cast<double>(a.total()));
}

TEST(FrameRendererTest, ExposureIsTheMeanOfImages) {
  const Scene scene = BallScene();
  const CameraModel camera = SynthCamera({.width_px = 160, .height_px = 120});
  const FrameRenderer renderer(scene, camera);
  std::vector<ImagePoses> moments;
  cv::Mat mean = cv::Mat::zeros(120, 160, CV_32FC3);
  constexpr int kMoments = 8;
  for (int k = 0; k < kMoments; ++k) {
    moments.emplace_back(AboveTurned(0.06 * ((k + 0.5) / kMoments - 0.5)));
    mean += Linear(renderer.Render(moments.back()).color_bgr) / kMoments;
  }
  const TrueFrame sharp = renderer.Render(ImagePoses(AboveTurned(0)));
  const TrueFrame blurred = renderer.Render(ImagePoses(AboveTurned(0)), moments);
  EXPECT_EQ(cv::countNonZero(sharp.labels != blurred.labels), 0);
  EXPECT_EQ(cv::countNonZero(sharp.depth_m != blurred.depth_m), 0);
  const double difference = RootMeanSquare(Linear(blurred.color_bgr), mean);
  EXPECT_LT(difference, 0.03);
  EXPECT_GT(RootMeanSquare(Linear(sharp.color_bgr), mean), 3 * difference);
}

TEST(FrameRendererTest, ExposureWithoutMotionChangesLittle) {
  const Scene scene = BallScene();
  const CameraModel camera = SynthCamera({.width_px = 160, .height_px = 120});
  const FrameRenderer renderer(scene, camera);
  const std::vector<ImagePoses> moments(4, ImagePoses(Above()));
  const TrueFrame sharp = renderer.Render(ImagePoses(Above()));
  cv::Mat difference;
  cv::absdiff(sharp.color_bgr, renderer.Render(ImagePoses(Above()), moments).color_bgr, difference);
  EXPECT_LT(cv::mean(difference)[1], 4);
}

TEST(FrameRendererTest, PixelsWithoutSurfaceHaveTheBackgroundColor) {
  Scene scene = BallScene();
  scene.background = FromHsv(0, 0, 0.5);
  CameraModel camera = SynthCamera({.width_px = 40, .height_px = 30});
  const SE3<World, Camera> upward(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 1));
  for (const double distortion : {0.0, 1e-9}) {
    camera.distortion[0] = distortion;
    const TrueFrame frame = FrameRenderer(scene, camera).Render(ImagePoses(upward));
    EXPECT_EQ(cv::countNonZero(frame.depth_m), 0);
    for (const cv::Vec3b& pixel : cv::Mat_<cv::Vec3b>(frame.color_bgr)) {
      for (int k = 0; k < 3; ++k) ASSERT_NEAR(pixel[k], 128, 3);
    }
  }
}

}  // namespace romap::synth::frame_renderer_test
