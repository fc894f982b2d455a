#include "tests/support/sample_recording.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "common/color_image.h"
#include "common/label_png.h"

namespace romap::testing_support {
namespace {

constexpr int kSampleWidth_px = 48, kSampleHeight_px = 36;

// Smooth, so that a JPEG file keeps the colors, and different in every frame and direction.
cv::Mat SampleColor(int frame) {
  cv::Mat color(kSampleHeight_px, kSampleWidth_px, CV_8UC3);
  for (int y = 0; y < color.rows; ++y) {
    for (int x = 0; x < color.cols; ++x) {
      color.at<cv::Vec3b>(y, x) = {static_cast<uint8_t>(40 + 4 * x), static_cast<uint8_t>(30 + 5 * y),
                                   static_cast<uint8_t>(20 + 10 * (frame % 20))};
    }
  }
  return color;
}

Eigen::Matrix4d SamplePose(int frame) {
  const Eigen::Quaterniond rotation =
      Eigen::AngleAxisd(0.3 + 0.11 * frame, Eigen::Vector3d(0.2, -1, 0.4).normalized()) *
      Eigen::AngleAxisd(-1.1, Eigen::Vector3d::UnitX());
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topLeftCorner<3, 3>() = rotation.toRotationMatrix();
  pose.topRightCorner<3, 1>() = Eigen::Vector3d(0.1 * frame, 1.5 - 0.05 * frame, 0.7 + 0.02 * frame * frame);
  return pose;
}

void ExpectPose(const std::optional<SE3<World, Camera>>& pose, const Eigen::Matrix4d& expected) {
  ASSERT_TRUE(pose);
  EXPECT_LT((pose->Matrix() - expected).cwiseAbs().maxCoeff(), 1e-6) << pose->Matrix() << "\nexpected\n" << expected;
}

void ExpectMasks(const FrameInput& frame, const SampleRecording& sample, const cv::Mat& expected, bool classes) {
  const auto labels = DecodeLabelPng(frame.label_png);
  ASSERT_TRUE(labels.ok()) << labels.status();
  ASSERT_EQ(labels->size(), expected.size());
  EXPECT_EQ(cv::countNonZero((*labels != 0) != (expected != 0)), 0);
  // The numbers of the labels may differ; each label must cover one object, with its class.
  for (const auto& [label, name] : sample.classes) {
    const cv::Mat object = expected == label;
    if (cv::countNonZero(object) == 0) continue;
    double first = 0, last = 0;
    cv::minMaxLoc(*labels, &first, &last, nullptr, nullptr, object);
    EXPECT_EQ(first, last) << name;
    if (!classes) continue;
    const auto instance =
        std::find_if(frame.instances.begin(), frame.instances.end(), [&](const auto& i) { return i.label == first; });
    ASSERT_NE(instance, frame.instances.end()) << name;
    EXPECT_EQ(instance->class_name, name);
  }
}

void ExpectDepth(const FrameInput& frame, const cv::Mat& expected_mm, double error_m) {
  const cv::Mat raw(1, static_cast<int>(frame.depth.size()), CV_8UC1, const_cast<char*>(frame.depth.data()));
  const cv::Mat depth = cv::imdecode(raw, cv::IMREAD_UNCHANGED);
  ASSERT_EQ(depth.type(), CV_16UC1);
  ASSERT_EQ(depth.size(), expected_mm.size());
  cv::Mat depth_m, expected_m;
  depth.convertTo(depth_m, CV_64F, frame.depth_scale_mu);
  expected_mm.convertTo(expected_m, CV_64F, 1e-3);
  EXPECT_LE(cv::norm(depth_m, expected_m, cv::NORM_INF), error_m);
}

void ExpectCamera(const CameraModel& camera, const CameraModel& expected) {
  EXPECT_EQ(camera.width_px, expected.width_px);
  EXPECT_EQ(camera.height_px, expected.height_px);
  EXPECT_NEAR(camera.fx_px, expected.fx_px, 1e-6);
  EXPECT_NEAR(camera.fy_px, expected.fy_px, 1e-6);
  EXPECT_NEAR(camera.cx_px, expected.cx_px, 1e-6);
  EXPECT_NEAR(camera.cy_px, expected.cy_px, 1e-6);
  EXPECT_EQ(camera.lens, expected.lens);
  for (size_t k = 0; k < camera.distortion.size(); ++k) EXPECT_NEAR(camera.distortion[k], expected.distortion[k], 1e-9);
}

void ExpectTime(const files::Sequence& sequence, size_t index, double time_step_s) {
  if (index == 0) return;
  const int64_t step_ns = sequence.timestamp_ns(index) - sequence.timestamp_ns(index - 1);
  EXPECT_GT(step_ns, 0);
  if (time_step_s == 0) return;
  EXPECT_NEAR(1e-9 * static_cast<double>(step_ns), time_step_s, 1e-6);
}

}  // namespace

void WriteText(const std::string& path, std::string_view text) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  std::ofstream out(path, std::ios::binary);
  out.write(text.data(), static_cast<std::streamsize>(text.size()));
  EXPECT_TRUE(out) << path;
}

void WriteImage(const std::string& path, const cv::Mat& image) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  EXPECT_TRUE(cv::imwrite(path, image)) << path;
}

SampleRecording MakeSample(int frames) {
  SampleRecording sample;
  sample.camera = {.width_px = kSampleWidth_px,
                   .height_px = kSampleHeight_px,
                   .fx_px = 50.25,
                   .fy_px = 51.5,
                   .cx_px = 23.75,
                   .cy_px = 17.25};
  sample.classes = {{1, "cup"}, {2, "book"}};
  for (int k = 0; k < frames; ++k) {
    SampleFrame frame{.time_s = 0.1 * k, .color = SampleColor(k)};
    frame.labels = cv::Mat::zeros(frame.color.size(), CV_16UC1);
    frame.labels(cv::Rect(4 + k % 8, 6, 12, 10)) = 1;
    frame.labels(cv::Rect(26, 12 + k % 6, 14, 12)) = 2;
    frame.depth_mm.create(frame.color.size(), CV_16UC1);
    for (int y = 0; y < frame.depth_mm.rows; ++y) {
      for (int x = 0; x < frame.depth_mm.cols; ++x) {
        frame.depth_mm.at<uint16_t>(y, x) = static_cast<uint16_t>(600 + 7 * x + 11 * y + 13 * k);
      }
    }
    frame.depth_mm(cv::Rect(0, 0, 5, 3)) = 0;
    frame.T_world_camera = SamplePose(k);
    sample.frames.push_back(frame);
  }
  return sample;
}

SampleRecording SampleOf(const files::Sequence& sequence) {
  SampleRecording sample{.camera = sequence.camera(), .frames = {}, .classes = {}};
  for (size_t k = 0; k < sequence.size(); ++k) {
    const absl::StatusOr<FrameInput> input = sequence.Load(k);
    EXPECT_TRUE(input.ok()) << input.status();
    SampleRange range;
    SampleFrame frame{.time_s = 1e-9 * static_cast<double>(input->timestamp_ns)};
    frame.color = *DecodeColor(input->image, &range);
    frame.labels = *DecodeLabelPng(input->label_png);
    if (!input->depth.empty()) {
      DecodeLabelPng(input->depth)->convertTo(frame.depth_mm, CV_16U, 1e3 * input->depth_scale_mu);
    }
    if (input->T_world_camera) frame.T_world_camera = input->T_world_camera->Matrix();
    for (const Instance& instance : input->instances) {
      sample.classes[static_cast<int>(instance.label)] = instance.class_name;
    }
    sample.frames.push_back(frame);
  }
  return sample;
}

void ExpectSample(const files::Sequence& sequence, const SampleRecording& sample, const SampleChecks& checks) {
  if (checks.camera) ExpectCamera(sequence.camera(), sample.camera);
  ASSERT_EQ(sequence.size(), sample.frames.size());
  for (size_t k = 0; k < sequence.size(); ++k) {
    SCOPED_TRACE(fmt::format("frame {}", k));
    const SampleFrame& truth = sample.frames[k];
    const absl::StatusOr<FrameInput> frame = sequence.Load(k);
    ASSERT_TRUE(frame.ok()) << frame.status();
    ExpectTime(sequence, k, checks.time_step_s);
    SampleRange range;
    const absl::StatusOr<cv::Mat> color = DecodeColor(frame->image, &range);
    ASSERT_TRUE(color.ok()) << color.status();
    ASSERT_EQ(color->size(), truth.color.size());
    EXPECT_LE(cv::norm(*color, truth.color, cv::NORM_INF), checks.colors ? 0 : 24);
    if (checks.poses) ExpectPose(frame->T_world_camera, truth.T_world_camera);
    if (checks.masks) ExpectMasks(*frame, sample, truth.labels, checks.classes);
    if (checks.depth) ExpectDepth(*frame, truth.depth_mm, checks.depth_error_m);
  }
}

}  // namespace romap::testing_support
