// Recordings with masks and depth as detectors and sensors really write them. Each must give the map of the sound
// sequence, or say what is wrong.

#include <gmock/gmock.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/integration/recording_fixture.h"

namespace romap::mask_recording_test {

using recordings::kObjects;
using recordings::RunResult;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing_support::Recording;

class MaskRecordingTest : public recordings::RecordingTest {};

constexpr uint8_t kSurface = 200;
constexpr int kGripper = 9;

cv::Mat ToLabels8(const cv::Mat& stored) {
  cv::Mat labels;
  stored.convertTo(labels, CV_8U);
  return labels;
}

cv::Mat GripperTexture(const cv::Size& size) {
  cv::Mat small(size.height / 10, size.width / 10, CV_8UC3), texture;
  cv::RNG(1).fill(small, cv::RNG::UNIFORM, 0, 255);
  cv::resize(small, texture, size, 0, 0, cv::INTER_CUBIC);
  return texture;
}

void AddGripper(const Recording& recording, int label) {
  const cv::Rect box(95, 165, 130, 75);
  const cv::Mat texture = GripperTexture(box.size());
  recording.ChangeImages("rgb", [&](cv::Mat image, size_t) {
    texture.copyTo(image(box));
    return image;
  });
  recording.ChangeImages("mask", [&](const cv::Mat& mask, size_t) {
    cv::Mat labels = ToLabels8(mask);
    labels(box).setTo(label);
    return labels;
  });
  if (label != 0) recording.AddDetections(label, "robot gripper");
}

// ----------------------------------------------------------------------------------------------------------- sound

TEST_F(MaskRecordingTest, ASoundRecordingGivesNoDiagnostics) {
  const RunResult result = RunTrained();
  ExpectTheShapes(result);
  EXPECT_THAT(result.Codes(), IsEmpty()) << result.process.out;
}

TEST_F(MaskRecordingTest, ASoundRecordingWithDepthGivesNoDiagnostics) {
  const RunResult result = Run({"--depth"});
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), IsEmpty()) << result.process.out;
}

// ----------------------------------------------------------------------------------------------------------- masks

TEST_F(MaskRecordingTest, ALabelForEverythingElseIsBackground) {
  recording().ChangeImages("mask", [](const cv::Mat& mask, size_t) {
    cv::Mat labels = ToLabels8(mask);
    labels.setTo(kSurface, labels == 0);
    return labels;
  });
  recording().AddDetections(kSurface, "table");
  const RunResult result = RunTrained();
  ExpectTheShapes(result);
  EXPECT_THAT(result.Codes(), Contains("mask_is_background"));
}

TEST_F(MaskRecordingTest, ALabelAroundTheObjectsIsBackground) {
  recording().ChangeImages("mask", [](const cv::Mat& mask, size_t) {
    cv::Mat labels = ToLabels8(mask), near;
    cv::dilate(labels > 0, near, cv::Mat::ones(41, 41, CV_8U));
    labels.setTo(kSurface, near & (labels == 0));
    return labels;
  });
  recording().AddDetections(kSurface, "dining table");
  const RunResult result = RunTrained();
  ExpectTheShapes(result);
  EXPECT_THAT(result.Classes(), Not(Contains("dining table")));
}

TEST_F(MaskRecordingTest, AGripperIsNoObject) {
  AddGripper(recording(), kGripper);
  const RunResult result = Run();
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_THAT(result.Classes(), Not(Contains("robot gripper")));
  EXPECT_LE(result.objects(), static_cast<size_t>(kObjects)) << "the gripper hides some of them";
  EXPECT_GE(result.objects(), static_cast<size_t>(kObjects) - 1);
}

TEST_F(MaskRecordingTest, AGripperWithoutAMaskDoesNotMoveTheMap) {
  AddGripper(recording(), 0);
  const RunResult result = Run({"--poses", "none"});
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_LT(result.summary["evaluation"]["trajectory"]["ate_rmse_m"].get<double>(), 0.01) << result.process.out;
}

TEST_F(MaskRecordingTest, MasksOfOtherImagesAreNamed) {
  std::vector<cv::Mat> masks;
  for (const std::string& file : recording().Files("mask")) masks.push_back(cv::imread(file, cv::IMREAD_UNCHANGED));
  recording().ChangeImages("mask", [&](const cv::Mat&, size_t k) { return masks[masks.size() - 1 - k]; });
  EXPECT_THAT(Run().Codes(), Contains("masks_contradict_images"));
}

TEST_F(MaskRecordingTest, LateMasksAreNamed) {
  std::vector<cv::Mat> masks;
  for (const std::string& file : recording().Files("mask")) masks.push_back(cv::imread(file, cv::IMREAD_UNCHANGED));
  recording().ChangeImages("mask", [&](const cv::Mat&, size_t k) { return masks[k < 4 ? 0 : k - 4]; });
  const RunResult result = Run();
  EXPECT_THAT(result.Codes(), Contains("masks_displaced"));
  EXPECT_THAT(result.process.err + result.process.out, HasSubstr("4 frames before"));
}

TEST_F(MaskRecordingTest, TheValue255OfMasksIsIgnored) {
  recording().ChangeImages("mask", [](const cv::Mat& mask, size_t) {
    const cv::Mat before = ToLabels8(mask);
    cv::Mat labels = before.clone();
    for (int label = 1; label < 255; ++label) {
      const cv::Mat object = before == label;
      if (cv::countNonZero(object) == 0) continue;
      cv::Mat grown, shrunk;
      cv::dilate(object, grown, cv::Mat::ones(3, 3, CV_8U), {-1, -1}, 2);
      cv::erode(object, shrunk, cv::Mat::ones(3, 3, CV_8U), {-1, -1}, 2);
      labels.setTo(255, grown & ~shrunk);
    }
    return labels;
  });
  const RunResult result = Run();
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_EQ(result.objects(), static_cast<size_t>(kObjects)) << result.process.out;
  EXPECT_THAT(result.Codes(), Contains("mask_value_255_ignored"));
}

// ----------------------------------------------------------------------------------------------------------- depth

TEST_F(MaskRecordingTest, TheDepth65535IsUnknown) {
  const std::vector<std::string> masks = recording().Files("mask");
  recording().ChangeImages("depth", [&](cv::Mat depth, size_t index) {
    depth.setTo(65535, cv::imread(masks[index], cv::IMREAD_UNCHANGED) > 0);
    return depth;
  });
  const RunResult result = Run({"--depth"});
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), Contains("depth_value_ignored"));
}

}  // namespace romap::mask_recording_test
