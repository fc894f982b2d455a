// Maps recordings as people bring them: copies of one sound sequence with unusual labels, depth, poses, images and
// lists. Each must give the map of the sound sequence, or say what is wrong.

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "client/synth/synth.h"
#include "tests/support/recording.h"
#include "tests/support/subprocess.h"

namespace romap::recordings_test {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing_support::ProcessResult;
using testing_support::Recording;

constexpr int kFrames = 60;
constexpr int kObjects = 4;

// The result of `romap run`.
struct Result {
  ProcessResult process;
  nlohmann::json summary;

  size_t objects() const { return summary["objects"].size(); }
  std::vector<std::string> Classes() const {
    std::vector<std::string> classes;
    for (const auto& object : summary["objects"]) classes.push_back(object["class"]);
    std::sort(classes.begin(), classes.end());
    return classes;
  }
  std::vector<std::string> Codes() const {
    std::vector<std::string> codes;
    for (const auto& diagnostic : summary["diagnostics"]) codes.push_back(diagnostic["code"]);
    return codes;
  }
  // Of the codes with a severity above info.
  std::vector<std::string> Warnings() const {
    std::vector<std::string> codes;
    for (const auto& diagnostic : summary["diagnostics"]) {
      if (diagnostic["severity"] != "info") codes.push_back(diagnostic["code"]);
    }
    return codes;
  }
  double Mean(const char* figure) const { return summary["evaluation"]["objects"]["mean"][figure]; }
};

class RecordingsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    synth::SynthOptions options;
    options.seed = 1;
    options.objects = kObjects;
    options.frames = kFrames;
    options.width_px = 320;
    options.height_px = 240;
    ASSERT_TRUE(synth::MakeSequence(options, folder_ / "base").ok());
    recording_.emplace(folder_ / "base", folder_ / "recording");
  }

  const Recording& recording() const { return *recording_; }

  Result Run(std::vector<std::string> options = {}) {
    std::vector<std::string> command = {ROMAP_CLIENT,    "run",     recording().dir(), "--out",
                                        folder_ / "map", "--local", "--no-pictures"};
    command.insert(command.end(), options.begin(), options.end());
    Result result;
    result.process = testing_support::RunProcess(command);
    if (std::ifstream in(folder_ / "map/summary.json"); in) result.summary = nlohmann::json::parse(in);
    return result;
  }

  // The map of the sound sequence, within the tolerance of so few frames.
  static void ExpectTheMap(const Result& result) {
    ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
    EXPECT_EQ(result.objects(), static_cast<size_t>(kObjects)) << result.process.out;
    if (result.summary["evaluation"].contains("objects")) {
      EXPECT_LT(result.Mean("comp_seen_cm"), 0.8) << result.process.out;
      EXPECT_LT(result.Mean("acc_cm"), 0.9) << result.process.out;
    }
  }

 private:
  testing_support::TemporaryFolder folder_;
  std::optional<Recording> recording_;
};

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

TEST_F(RecordingsTest, ASoundRecordingGivesNoDiagnostics) {
  const Result result = Run();
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), IsEmpty()) << result.process.out;
}

TEST_F(RecordingsTest, ASoundRecordingWithDepthGivesNoDiagnostics) {
  const Result result = Run({"--depth"});
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), IsEmpty()) << result.process.out;
}

// ----------------------------------------------------------------------------------------------------------- masks

TEST_F(RecordingsTest, ALabelForEverythingElseIsBackground) {
  recording().ChangeImages("mask", [](const cv::Mat& mask, size_t) {
    cv::Mat labels = ToLabels8(mask);
    labels.setTo(kSurface, labels == 0);
    return labels;
  });
  recording().AddDetections(kSurface, "table");
  const Result result = Run();
  ExpectTheMap(result);
  EXPECT_THAT(result.Codes(), Contains("mask_is_background"));
}

TEST_F(RecordingsTest, ALabelAroundTheObjectsIsBackground) {
  recording().ChangeImages("mask", [](const cv::Mat& mask, size_t) {
    cv::Mat labels = ToLabels8(mask), near;
    cv::dilate(labels > 0, near, cv::Mat::ones(41, 41, CV_8U));
    labels.setTo(kSurface, near & (labels == 0));
    return labels;
  });
  recording().AddDetections(kSurface, "dining table");
  const Result result = Run();
  ExpectTheMap(result);
  EXPECT_THAT(result.Classes(), Not(Contains("dining table")));
}

TEST_F(RecordingsTest, AGripperIsNoObject) {
  AddGripper(recording(), kGripper);
  const Result result = Run();
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_THAT(result.Classes(), Not(Contains("robot gripper")));
  EXPECT_LE(result.objects(), static_cast<size_t>(kObjects)) << "the gripper hides some of them";
  EXPECT_GE(result.objects(), static_cast<size_t>(kObjects) - 1);
}

TEST_F(RecordingsTest, AGripperWithoutAMaskDoesNotMoveTheMap) {
  AddGripper(recording(), 0);
  const Result result = Run({"--poses", "none"});
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_LT(result.summary["evaluation"]["trajectory"]["ate_rmse_cm"].get<double>(), 1.0) << result.process.out;
}

TEST_F(RecordingsTest, TheValue255OfMasksIsIgnored) {
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
  const Result result = Run();
  ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
  EXPECT_EQ(result.objects(), static_cast<size_t>(kObjects)) << result.process.out;
  EXPECT_THAT(result.Codes(), Contains("mask_value_255_ignored"));
}

// ----------------------------------------------------------------------------------------------------------- depth

TEST_F(RecordingsTest, TheDepth65535IsUnknown) {
  const std::vector<std::string> masks = recording().Files("mask");
  recording().ChangeImages("depth", [&](cv::Mat depth, size_t index) {
    depth.setTo(65535, cv::imread(masks[index], cv::IMREAD_UNCHANGED) > 0);
    return depth;
  });
  for (const char* poses : {"given", "none"}) {
    const Result result = Run({"--depth", "--poses", poses});
    ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
    EXPECT_EQ(result.objects(), static_cast<size_t>(kObjects)) << result.process.out;
    EXPECT_THAT(result.Codes(), Contains("depth_value_ignored"));
  }
}

}  // namespace romap::recordings_test
