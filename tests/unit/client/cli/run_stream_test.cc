#include "client/cli/run_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "client/cli/run_summary.h"
#include "client/files/text_file.h"
#include "common/status.h"
#include "tests/support/fake_mapping_service.h"

namespace romap::cli::run_stream_test {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
namespace fs = std::filesystem;

// A sequence of ten frames at 10 Hz with masks and poses.
class RunStreamTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(dir_);
    fs::create_directories(dir_ + "/rgb");
    fs::create_directories(dir_ + "/mask");
    Put("camera.yaml", "width: 32\nheight: 24\nfx: 30\nfy: 31\ncx: 15.5\ncy: 11.5\nfps: 10\n");
    std::string images, masks, poses;
    for (int k = 0; k < 10; ++k) {
      images += fmt::format("0.{} rgb/{}.png\n", k, k);
      masks += fmt::format("0.{} mask/{}.png\n", k, k);
      poses += fmt::format("0.{} 0 0 0 0 0 0 1\n", k);
      cv::imwrite(fmt::format("{}/rgb/{}.png", dir_, k), cv::Mat(24, 32, CV_8UC3, cv::Scalar(k, k, k)));
      cv::imwrite(fmt::format("{}/mask/{}.png", dir_, k), cv::Mat(24, 32, CV_8UC1, cv::Scalar(0)));
    }
    Put("rgb.txt", images);
    Put("mask.txt", masks);
    Put("groundtruth.txt", poses);
  }
  void TearDown() override { fs::remove_all(dir_); }

  void Put(const std::string& name, const std::string& text) {
    EXPECT_TRUE(files::WriteFile(dir_ + "/" + name, text).ok());
  }

  absl::StatusOr<StreamResult> Stream(const StreamOptions& options = {}) {
    sequence_ = files::Sequence::Open(dir_);
    if (!sequence_.ok()) return sequence_.status();
    return StreamSequence(*sequence_, service_, options, collector_);
  }

  const std::string dir_ =
      testing::TempDir() + "romap_stream_" + testing::UnitTest::GetInstance()->current_test_info()->name();
  testing_support::FakeMappingService service_;
  MapCollector collector_;
  absl::StatusOr<files::Sequence> sequence_;
};

TEST_F(RunStreamTest, SendsAllFramesOfASoundSequence) {
  const auto result = Stream();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->status.ok()) << result->status;
  EXPECT_TRUE(result->diagnostics.empty());
  const RunSummary summary = Summarize(*sequence_, *result, collector_, {});
  EXPECT_EQ(summary.frames_sent, 10u);
  EXPECT_EQ(summary.frames_with_pose, 10u);
  EXPECT_THAT(FormatSummary(summary), HasSubstr("poses: 10 of 10 frames have one\n"));
  EXPECT_EQ(ToJson(summary)["frames"]["with_pose"], 10);
}

TEST_F(RunStreamTest, FramesThatAreHeldOutAreNotSent) {
  StreamOptions options;
  options.first_frame = 1;
  options.hold_out = 4;
  const auto result = Stream(options);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->status.ok()) << result->status;
  EXPECT_EQ(collector_.sent(), 7u);
  EXPECT_THAT(HeldOutFrames(*sequence_, options), ElementsAre(3, 7));
  EXPECT_THAT(result->skipped_frames, ElementsAre(4, 8));
}

TEST_F(RunStreamTest, GoesOnWithoutAFewUnreadableFiles) {
  Put("rgb/3.png", "");
  Put("rgb/5.png", "not an image");
  fs::remove(dir_ + "/mask/4.png");
  const auto result = Stream();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->status.ok()) << result->status;
  EXPECT_THAT(result->skipped_frames, ElementsAre(4, 6));
  const RunSummary summary = Summarize(*sequence_, *result, collector_, {});
  EXPECT_EQ(summary.frames_sent, 8u);
  EXPECT_EQ(summary.frames_with_masks, 7u);
  ASSERT_EQ(summary.diagnostics.size(), 2u);
  const Diagnostic& images = summary.diagnostics[0];
  EXPECT_EQ(images.code, "file_unreadable");
  EXPECT_EQ(images.severity, Severity::kWarning);
  EXPECT_EQ(images.count, 2u);
  EXPECT_EQ(images.first_frame_id, 4u);
  EXPECT_THAT(images.text, AllOf(HasSubstr("2 of 10 images"), HasSubstr("rgb/3.png: the file is empty")));
  EXPECT_EQ(summary.diagnostics[1].first_frame_id, 5u);
  EXPECT_THAT(summary.diagnostics[1].text, AllOf(HasSubstr("1 of 10 masks"), HasSubstr("mask/4.png")));
  // Printed when the first of each kind was found.
  ASSERT_EQ(result->said.size(), 2u);
  EXPECT_EQ(result->said[0].first_frame_id, 4u);
  EXPECT_EQ(result->said[0].count, 1u);
  EXPECT_EQ(result->said[1].first_frame_id, 5u);
  EXPECT_THAT(FormatSummary(summary),
              HasSubstr("diagnostics: 2 warnings: file_unreadable (2 times), file_unreadable\n"));
  const nlohmann::json json = ToJson(summary);
  EXPECT_EQ(json["frames"]["skipped"], nlohmann::json({4, 6}));
  EXPECT_EQ(json["diagnostics"].size(), 2u);
}

TEST_F(RunStreamTest, EndsIfMoreThanAFifthIsUnreadable) {
  for (const char* name : {"mask/1.png", "mask/2.png", "mask/7.png"}) Put(name, "");
  const auto result = Stream();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(Message(result->status),
              AllOf(HasSubstr("at least 3 of 10 masks cannot be read"), HasSubstr("mask/1.png: the file is empty")));
  EXPECT_EQ(collector_.sent(), 7u);
}

TEST_F(RunStreamTest, SummaryHasTheDiagnosticsOfTheSequenceAndOfTheServer) {
  Put("groundtruth.txt", "50 0 0 0 0 0 0 1\n");
  const auto result = Stream();
  ASSERT_TRUE(result.ok()) << result.status();
  Statistics statistics;
  statistics.diagnostics.push_back({.code = "up_unknown", .text = "up is not known"});
  collector_.Apply(statistics);
  const std::string text = FormatSummary(Summarize(*sequence_, *result, collector_, {}));
  EXPECT_THAT(text, AllOf(HasSubstr("poses: 0 of 10 frames have one"), Not(HasSubstr("none of the 1 poses")),
                          HasSubstr("warning: up_unknown: up is not known\n"),
                          HasSubstr("diagnostics: 2 warnings: poses_unmatched, up_unknown\n")));
  ASSERT_EQ(result->said.size(), 1u);
  EXPECT_EQ(result->said[0].code, "poses_unmatched");
}

}  // namespace romap::cli::run_stream_test
