#include "server/slam/slam_config.h"

#include <gtest/gtest.h>

#include "tests/support/config_faults.h"

namespace romap::slam::slam_config_test {

std::string Faults(const std::vector<std::string>& assignments) {
  return testing_support::FaultsOf<SlamConfig>("slam", assignments);
}

TEST(SlamConfigTest, DefaultsAreValid) { EXPECT_EQ(Faults({}), ""); }

TEST(SlamConfigTest, MinimumFastThresholdMustNotExceedTheThreshold) {
  EXPECT_EQ(Faults({"slam.scene_fast_min_threshold=12"}), "");
  EXPECT_EQ(Faults({"slam.scene_fast_min_threshold=13"}),
            "--set: slam.scene_fast_min_threshold = 13 must not exceed slam.scene_fast_threshold = 12");
}

TEST(SlamConfigTest, MatchedAndAdjustedKeyframesMustFitIntoTheMap) {
  EXPECT_EQ(Faults({"slam.max_keyframes=10", "slam.matched_keyframes=10", "slam.window_keyframes=10"}), "");
  EXPECT_EQ(Faults({"slam.max_keyframes=10", "slam.matched_keyframes=11", "slam.window_keyframes=12"}),
            "--set: slam.matched_keyframes = 11 must not exceed slam.max_keyframes = 10; "
            "--set: slam.window_keyframes = 12 must not exceed slam.max_keyframes = 10");
}

}  // namespace romap::slam::slam_config_test
