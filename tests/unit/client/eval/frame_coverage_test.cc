#include "client/eval/frame_coverage.h"

#include <gtest/gtest.h>

#include <vector>

namespace romap::eval::frame_coverage_test {

std::vector<int64_t> Range(int64_t first, int64_t end, int64_t step) {
  std::vector<int64_t> values;
  for (int64_t value = first; value < end; value += step) values.push_back(value);
  return values;
}

TEST(FrameCoverageTest, DistinguishesInitializationFromLostFrames) {
  std::vector<int64_t> poses = Range(300, 1000, 100);  // frames 3..9
  poses.erase(poses.begin() + 2, poses.begin() + 4);   // without frames 5 and 6
  const FrameCoverage coverage = CoverageOf(Range(0, 1100, 100), poses);
  EXPECT_EQ(coverage.frames, 11u);
  EXPECT_EQ(coverage.tracked, 5u);
  EXPECT_EQ(coverage.before_first, 3u);
  EXPECT_EQ(coverage.lost, 3u) << "frames 5, 6 and 10";
  EXPECT_FALSE(coverage.inferred);
}

TEST(FrameCoverageTest, WithoutPosesNoFrameIsTracked) {
  const FrameCoverage coverage = CoverageOf(Range(0, 500, 100), {});
  EXPECT_EQ(coverage.before_first, 5u);
  EXPECT_EQ(coverage.lost, 0u);
  EXPECT_EQ(coverage.TrackedShare(), 0);
}

TEST(FrameCoverageTest, InfersFramesFromThePeriodOfThePoses) {
  std::vector<int64_t> poses = Range(200, 1000, 100);
  poses.erase(poses.begin() + 3);
  const FrameCoverage coverage = InferCoverage(poses, 0, 1200);
  EXPECT_TRUE(coverage.inferred);
  EXPECT_EQ(coverage.tracked, 7u);
  EXPECT_EQ(coverage.before_first, 2u);
  EXPECT_EQ(coverage.lost, 4u);
  EXPECT_EQ(coverage.frames, 13u);
}

TEST(FrameCoverageTest, ASinglePoseDeterminesNoPeriod) {
  const FrameCoverage coverage = InferCoverage(std::vector<int64_t>{500}, 0, 1000);
  EXPECT_EQ(coverage.frames, 1u);
  EXPECT_EQ(coverage.tracked, 1u);
}

}  // namespace romap::eval::frame_coverage_test
