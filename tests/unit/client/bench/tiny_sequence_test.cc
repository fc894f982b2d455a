#include "tests/unit/client/bench/tiny_sequence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <opencv2/imgcodecs.hpp>

#include "client/files/ply.h"

namespace romap::testing_support {
namespace {

namespace fs = std::filesystem;

constexpr double kDepthScale = 1e-4;  // m per unit

CameraModel Camera() {
  return {.width_px = 120, .height_px = 90, .fx_px = 130, .fy_px = 130, .cx_px = 59.5, .cy_px = 44.5};
}

SE3<World, romap::Camera> PoseOf(int frame) {
  const double azimuth = 2 * std::numbers::pi * frame / TinySequence::kFrames;
  const double elevation = frame % 2 == 0 ? 0.7 : -0.3;
  const Eigen::Vector3d toward(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                               std::sin(elevation));
  const Eigen::Vector3d right = (-toward).cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d axes;
  axes << right, (-toward).cross(right), -toward;
  return {axes, 0.6 * toward};
}

cv::Vec3b Stripes(const Eigen::Vector3d& normal) {
  const auto byte = [](double x) { return static_cast<uint8_t>(127.5 + 100 * std::sin(x)); };
  return {byte(9 * normal.x()), byte(8 * normal.y()), byte(7 * normal.z())};
}

struct Images {
  cv::Mat color{90, 120, CV_8UC3, cv::Scalar(200, 180, 160)};
  cv::Mat labels{90, 120, CV_8UC1, cv::Scalar(0)};
  cv::Mat depth{90, 120, CV_16UC1, cv::Scalar(0)};
};

void DrawPixel(const SE3<World, romap::Camera>& T_world_camera, cv::Point at, Images& images) {
  const Eigen::Vector3d ray_camera = Camera().Unproject(at.x, at.y);
  const Eigen::Vector3d ray = (T_world_camera.RotationMatrix() * ray_camera).normalized();
  double nearest_m = 1e9;
  for (const TinyBall& ball : TinySequence::Balls()) {
    const Eigen::Vector3d to_center = ball.center_world - T_world_camera.translation();
    const double along = to_center.dot(ray);
    const double square = ball.radius_m * ball.radius_m - (to_center.squaredNorm() - along * along);
    if (square < 0 || along - std::sqrt(square) > nearest_m) continue;
    nearest_m = along - std::sqrt(square);
    const Eigen::Vector3d p = T_world_camera.translation() + nearest_m * ray;
    images.color.at<cv::Vec3b>(at) = Stripes((p - ball.center_world).normalized());
    images.labels.at<uint8_t>(at) = static_cast<uint8_t>(ball.id);
    images.depth.at<uint16_t>(at) = static_cast<uint16_t>(std::lround(nearest_m / ray_camera.norm() / kDepthScale));
  }
}

Mesh SurfacePoints(const TinyBall& ball) {
  constexpr int kPoints = 4000;
  Mesh cloud;
  for (int i = 0; i < kPoints; ++i) {  // evenly, along a spiral
    const double z = 1 - (2 * i + 1.0) / kPoints, turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const Eigen::Vector3d normal(std::sqrt(1 - z * z) * std::cos(turn), std::sqrt(1 - z * z) * std::sin(turn), z);
    cloud.vertices.push_back((ball.center_world + ball.radius_m * normal).cast<float>());
  }
  return cloud;
}

void WriteFrames(const std::string& dir) {
  std::ofstream rgb(dir + "/rgb.txt"), mask(dir + "/mask.txt"), depth(dir + "/depth.txt");
  std::vector<files::StampedPose> poses;
  for (int frame = 0; frame < TinySequence::kFrames; ++frame) {
    poses.push_back({frame * int64_t{100'000'000}, PoseOf(frame)});
    Images images;
    for (int y = 0; y < images.color.rows; ++y) {
      for (int x = 0; x < images.color.cols; ++x) DrawPixel(PoseOf(frame), {x, y}, images);
    }
    const auto write = [&](std::ofstream& list, const char* folder, const cv::Mat& image) {
      const std::string name = fmt::format("{}/{}.png", folder, frame);
      EXPECT_TRUE(cv::imwrite(dir + "/" + name, image));
      list << fmt::format("{:.1f} {}\n", 0.1 * frame, name);
    };
    write(rgb, "rgb", images.color);
    write(mask, "mask", images.labels);
    write(depth, "depth", images.depth);
  }
  EXPECT_TRUE(files::WriteTum(dir + "/groundtruth.txt", poses).ok());
}

TEST(TinySequenceTest, BothBallsAreVisibleInEveryFrame) {
  const TinySequence data;
  const files::Sequence sequence = data.Open();
  ASSERT_EQ(sequence.size(), static_cast<size_t>(TinySequence::kFrames));
  EXPECT_EQ(sequence.objects()->objects.size(), TinySequence::Balls().size());
  for (size_t i = 0; i < sequence.size(); ++i) {
    const cv::Mat labels = cv::imread(fmt::format("{}/mask/{}.png", data.dir(), i), cv::IMREAD_UNCHANGED);
    for (const TinyBall& ball : TinySequence::Balls()) {
      EXPECT_GT(cv::countNonZero(labels == static_cast<int>(ball.id)), 40)
          << "frame " << i << "; one occludes a part of the other";
    }
  }
}

}  // namespace

TinySequence::TinySequence() {
  for (const char* folder : {"rgb", "mask", "depth", "gt"}) fs::create_directories(dir() + "/" + folder);
  WriteFrames(dir());
  EXPECT_TRUE(files::WriteCameraYaml(dir() + "/camera.yaml", {Camera(), 10, kDepthScale}).ok());
  files::ObjectsYaml objects;
  for (const TinyBall& ball : Balls()) {
    objects.objects.push_back({ball.id,
                               ball.name,
                               "ball",
                               {Eigen::Quaterniond::Identity(), ball.center_world},
                               Eigen::Vector3d::Constant(ball.radius_m),
                               std::nullopt});
    EXPECT_TRUE(files::WritePly(fmt::format("{}/gt/{}.ply", dir(), ball.name), SurfacePoints(ball)).ok());
  }
  EXPECT_TRUE(files::WriteObjects(dir() + "/objects.yaml", objects).ok());
}

files::Sequence TinySequence::Open() const {
  absl::StatusOr<files::Sequence> sequence = files::Sequence::Open(dir(), {.use_depth = true});
  EXPECT_TRUE(sequence.ok()) << Message(sequence.status());
  return *std::move(sequence);
}

const std::vector<TinyBall>& TinySequence::Balls() {
  static const std::vector<TinyBall> kBalls = {{1, "large", {-0.1, 0, 0}, 0.07}, {2, "small", {0.1, 0.04, 0.02}, 0.06}};
  return kBalls;
}

}  // namespace romap::testing_support
