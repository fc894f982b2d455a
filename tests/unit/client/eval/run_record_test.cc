#include "client/eval/run_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/text_file.h"
#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::run_record_test {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class RunRecordTest : public testing::Test {
 protected:
  RunRecord Read(const std::string& summary) {
    EXPECT_TRUE(files::WriteFile(folder_ / "summary.json", summary).ok());
    return ReadRunRecord(folder_ / ".");
  }

  // A sequence of five frames at 10 Hz.
  absl::StatusOr<files::Sequence> MakeSequence() {
    std::string list;
    for (int k = 0; k < 5; ++k) {
      const std::string image = fmt::format("rgb/{}.png", k);
      EXPECT_TRUE(files::WriteFile(folder_ / image, "").ok());
      list += fmt::format("0.{} {}\n", k, image);
    }
    EXPECT_TRUE(files::WriteFile(folder_ / "rgb.txt", list).ok());
    EXPECT_TRUE(
        files::WriteFile(folder_ / "camera.yaml", "width: 64\nheight: 48\nfx: 60\nfy: 60\ncx: 32\ncy: 24\nfps: 10\n")
            .ok());
    return files::Sequence::Open(folder_ / ".");
  }

  eval_world::TempFolder folder_;
};

TEST_F(RunRecordTest, ReadsTheSummary) {
  const RunRecord record = Read(R"({"poses": "none", "frames": {"first": 2, "sent": 3, "skipped": [4, 5]}})");
  EXPECT_THAT(record.skipped_frames, ElementsAre(4, 5));
  EXPECT_EQ(record.poses, "none");
  EXPECT_EQ(record.first_frame, 2u);
  EXPECT_EQ(record.frames_sent, 3u);
}

TEST_F(RunRecordTest, MissingOrMalformedValuesAreAbsent) {
  for (const char* summary :
       {"{}", "not JSON", "[]", R"({"poses": 5, "frames": [1]})", R"({"frames": {"sent": -1}})"}) {
    const RunRecord record = Read(summary);
    EXPECT_FALSE(record.poses || record.first_frame || record.frames_sent) << summary;
  }
  EXPECT_FALSE(ReadRunRecord(folder_ / "none").poses.has_value());
}

TEST_F(RunRecordTest, DeterminesTheFramesOfTheRun) {
  const absl::StatusOr<files::Sequence> sequence = MakeSequence();
  ASSERT_TRUE(sequence.ok()) << sequence.status();
  EXPECT_THAT(FramesOf({.first_frame = 1, .frames_sent = 2}, *sequence), ElementsAre(100'000'000, 200'000'000));
  EXPECT_THAT(FramesOf({.frames_sent = 5}, *sequence), SizeIs(5)) << "the whole sequence";
  EXPECT_THAT(FramesOf({.frames_sent = 2}, *sequence), IsEmpty()) << "unknown which two";
  EXPECT_THAT(FramesOf({.first_frame = 1, .frames_sent = 2, .skipped_frames = {3}}, *sequence),
              ElementsAre(100'000'000, 300'000'000));
  EXPECT_THAT(FramesOf({.frames_sent = 4, .skipped_frames = {1}}, *sequence), SizeIs(4)) << "the whole sequence";
  EXPECT_THAT(FramesOf({.first_frame = 9, .frames_sent = 2}, *sequence), IsEmpty());
}

}  // namespace romap::eval::run_record_test
