#include "client/files/detections.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/text_file.h"

namespace romap::files::detections_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class DetectionsTest : public testing::Test {
 protected:
  absl::StatusOr<DetectionFile> Read(const std::string& text) {
    EXPECT_TRUE(WriteFile(path_, text).ok());
    return ReadDetections(path_);
  }
  std::string ErrorOf(const std::string& text) { return std::string(Read(text).status().message()); }
  void TearDown() override { std::filesystem::remove(path_); }

  const std::string path_ =
      testing::TempDir() + "romap_detections_" + testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv";
};

std::vector<int64_t> Match(const DetectionFile& file, const std::vector<int64_t>& masks_ms, int64_t max_dt_ms) {
  std::vector<int64_t> masks_ns;
  for (const int64_t time_ms : masks_ms) masks_ns.push_back(1'000'000 * time_ms);
  return MatchDetections(file, masks_ns, 1'000'000 * max_dt_ms);
}

TEST_F(DetectionsTest, ClassNamesKeepAllCharacters) {
  const auto file = Read("time,label,class,score\n0.0,1,cup #2; red,0.5\n0.0,2,\"knife, \"\"big\"\"\"\n# 0.0,3,x\n");
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_EQ(file->sets.size(), 1u);
  ASSERT_EQ(file->sets[0].instances.size(), 2u);
  EXPECT_EQ(file->sets[0].instances[0].class_name, "cup #2; red");
  EXPECT_EQ(file->sets[0].instances[1].class_name, "knife, \"big\"");
  EXPECT_EQ(file->sets[0].instances[1].score, 1);
  EXPECT_FALSE(file->scores_in_percent);
}

TEST_F(DetectionsTest, ScoresMayBePercent) {
  const auto percent = Read("0,1,cup,87.5\n0,2,cup,0.5\n1,1,cup,100\n");
  ASSERT_TRUE(percent.ok()) << percent.status();
  EXPECT_TRUE(percent->scores_in_percent);
  EXPECT_DOUBLE_EQ(percent->sets[0].instances[0].score, 0.875);
  EXPECT_DOUBLE_EQ(percent->sets[0].instances[1].score, 0.005);
  const auto rounded = Read("0,1,cup,1.0000001\n0,2,cup,0.5\n");
  EXPECT_FALSE(rounded->scores_in_percent);
  EXPECT_EQ(rounded->sets[0].instances[0].score, 1);
  EXPECT_THAT(ErrorOf("0,1,cup,0.5\n0,2,cup,101\n"), HasSubstr(":2: score '101' must be a number from 0 to 1"));
  EXPECT_THAT(ErrorOf("0,1,cup,-1\n"), HasSubstr(":1: score '-1'"));
}

TEST_F(DetectionsTest, TimestampsMayBeNanoseconds) {
  const auto file = Read("1700000000000000001,1,cup\n1700000000033333334,1,cup\n");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(file->unit, TimeUnit::kNanoseconds);
  EXPECT_EQ(file->sets[1].timestamp_ns, 1700000000033333334);
}

TEST_F(DetectionsTest, NamesTheLineOfAMalformedRow) {
  EXPECT_THAT(ErrorOf("0,1,cup, red,0.5\n"), HasSubstr(":1: 5 fields; expected timestamp,label,class[,score]"));
  EXPECT_THAT(ErrorOf("0,1,cup\nx,1,cup\n"), HasSubstr(":2: 'x' is not a timestamp"));
  EXPECT_THAT(ErrorOf("x0,1,cup\n"), HasSubstr(":1: 'x0' is not a timestamp")) << "no header";
  EXPECT_THAT(ErrorOf("1,1,cup\n0,1,cup\n"), HasSubstr(":2: timestamps must not decrease"));
}

TEST_F(DetectionsTest, EachMaskTakesTheNearestSetWithinHalfAFrame) {
  const auto file = Read("0.0,1,cup\n0.1,1,book\n0.25,1,pen\n");
  EXPECT_THAT(Match(*file, {4, 96, 310}, 50), ElementsAre(0, 1, -1));
  EXPECT_THAT(Match(*file, {96, 104}, 50), ElementsAre(1, -1)) << "one to one";
}

TEST_F(DetectionsTest, RoundedTimestampsMatchIfTheyDistinguishTheMasks) {
  // Masks at 7.5 Hz, rounded to 0.1 s: by up to 33 ms, more than half of a frame at 30 Hz.
  const auto file = Read("0.0,1,cup\n0.1,1,pen\n0.3,1,cup\n0.4,1,pen\n");
  EXPECT_FALSE(file->timestamps_repeat);
  EXPECT_THAT(Match(*file, {0, 133, 267, 400, 533}, 16), ElementsAre(0, 1, 2, 3, -1));
  EXPECT_THAT(Match(*file, {33, 67}, 16), ElementsAre(-1, -1)) << "the period of the masks is less than the rounding";
}

TEST_F(DetectionsTest, RoundedTimestampsOfOneClassPerLabelMatchAllTheirFrames) {
  // 30 Hz, rounded to 0.1 s.
  const auto file = Read("0.0,1,cup,0.5\n0.0,1,cup,1\n0.0,2,pen,1\n0.1,1,cup,1\n0.1,1,cup,1\n0.1,1,cup,1\n");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_TRUE(file->timestamps_repeat);
  EXPECT_EQ(file->resolution_ns, 100'000'000);
  ASSERT_EQ(file->sets[0].instances.size(), 2u);
  EXPECT_EQ(file->sets[0].instances[0].score, 0.75);
  EXPECT_EQ(file->sets[0].rows, 3u);
  EXPECT_THAT(Match(*file, {0, 33, 67, 100, 133, 167}, 16), ElementsAre(0, 0, 1, 1, 1, -1));
}

TEST_F(DetectionsTest, RefusesTimestampsThatDoNotDistinguishFrames) {
  EXPECT_THAT(ErrorOf("0.0,1,cup\n0.1,1,cup\n0.1,2,pen\n0.1,1,book\n"),
              HasSubstr(":4: label 1 is 'book' here and 'cup' in line 2, both at timestamp 0.1; each label of a frame "
                        "has one row, and each frame needs a timestamp of its own"));
}

}  // namespace romap::files::detections_test
