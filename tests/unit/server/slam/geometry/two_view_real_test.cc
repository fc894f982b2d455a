// Two views of a real hand-held camera, because synthetic noise does not include motion blur, rolling shutter and
// repeated texture.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "server/slam/geometry/two_view.h"
#include "tests/unit/server/slam/geometry/synthetic_scene.h"

namespace romap::slam::two_view_real_test {

struct TimedPose {
  double time_s = 0;
  SE3<World, Camera> T_world_camera;
};

struct View {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
};

// The data lines of a text file, without comments.
std::vector<std::string> Lines(const std::filesystem::path& file) {
  std::vector<std::string> lines;
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty() && line[0] != '#') lines.push_back(line);
  }
  return lines;
}

std::vector<TimedPose> ReadTrajectory(const std::filesystem::path& file) {
  std::vector<TimedPose> poses;
  for (const std::string& line : Lines(file)) {
    std::istringstream values(line);
    TimedPose pose;
    Eigen::Vector3d translation;
    Eigen::Quaterniond rotation;
    values >> pose.time_s >> translation.x() >> translation.y() >> translation.z();
    values >> rotation.x() >> rotation.y() >> rotation.z() >> rotation.w();
    pose.T_world_camera = {rotation, translation};
    poses.push_back(pose);
  }
  return poses;
}

View Extract(const std::filesystem::path& image) {
  View view;
  const cv::Mat gray = cv::imread(image.string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  cv::ORB::create(1500)->detectAndCompute(gray, cv::noArray(), view.keypoints, view.descriptors);
  return view;
}

std::vector<TwoViewMatch> Match(const View& first, const View& second) {
  std::vector<std::vector<cv::DMatch>> nearest_two;
  cv::BFMatcher(cv::NORM_HAMMING).knnMatch(first.descriptors, second.descriptors, nearest_two, 2);
  std::vector<TwoViewMatch> matches;
  for (const std::vector<cv::DMatch>& candidates : nearest_two) {
    if (candidates.size() < 2 || candidates[0].distance > 0.8f * candidates[1].distance) continue;
    const cv::KeyPoint& a = first.keypoints[candidates[0].queryIdx];
    const cv::KeyPoint& b = second.keypoints[candidates[0].trainIdx];
    matches.push_back({.first_px = {a.pt.x, a.pt.y},
                       .second_px = {b.pt.x, b.pt.y},
                       .sigma_px = std::pow(1.2, std::max(a.octave, b.octave))});
  }
  return matches;
}

TEST(TwoViewReal, NeverReturnsAWrongMotionForHandHeldFrames) {
  const char* data_dir = std::getenv("ROMAP_DATA_DIR");
  if (data_dir == nullptr) GTEST_SKIP() << "ROMAP_DATA_DIR is not set";
  const std::filesystem::path sequence = std::filesystem::path(data_dir) / "redkitchen_600";
  const CameraModel camera{
      .width_px = 640, .height_px = 480, .fx_px = 525.7, .fy_px = 525.7, .cx_px = 320, .cy_px = 240};
  const std::vector<TimedPose> trajectory = ReadTrajectory(sequence / "groundtruth.txt");
  const std::vector<std::string> images = Lines(sequence / "rgb.txt");
  constexpr size_t kGap = 15;  // frames
  int tried = 0;
  int found = 0;
  for (size_t first = 0; first + kGap < std::min(trajectory.size(), images.size()); first += 40) {
    const auto path = [&](size_t frame) { return sequence / images[frame].substr(images[frame].find(' ') + 1); };
    const TwoViewResult result = SolveTwoView(camera, Match(Extract(path(first)), Extract(path(first + kGap))), {});
    ++tried;
    if (result.outcome != TwoViewOutcome::kOk) continue;
    ++found;
    const SE3<Camera, Camera> truth =
        trajectory[first].T_world_camera.Inverse() * trajectory[first + kGap].T_world_camera;
    EXPECT_LT(AngleBetween_deg(truth.rotation(), result.T_first_second.rotation()), 3) << "frame " << first;
    // The two ground truths of this sequence differ from each other by up to 30 degrees over such short baselines.
    EXPECT_LT(AngleBetween_deg(truth.translation(), result.T_first_second.translation()), 30) << "frame " << first;
  }
  ASSERT_GT(tried, 10);
  EXPECT_GT(found, tried / 4);
}

}  // namespace romap::slam::two_view_real_test
