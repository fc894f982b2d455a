#include "server/objects/objects_config.h"

#include <gtest/gtest.h>

#include "tests/support/config_faults.h"

namespace romap::objects::objects_config_test {

std::string Faults(const std::vector<std::string>& assignments) {
  return testing_support::FaultsOf<ObjectsConfig>("objects", assignments);
}

TEST(ObjectsConfigTest, DefaultsAreValid) { EXPECT_EQ(Faults({}), ""); }

TEST(ObjectsConfigTest, KeyframeDetectionsMustNotExceedAllDetections) {
  EXPECT_EQ(Faults({"objects.confirm_frames=3"}), "");
  EXPECT_EQ(Faults({"objects.confirm_frames=2"}),
            "--set: objects.confirm_keyframes = 3 must not exceed objects.confirm_frames = 2");
}

TEST(ObjectsConfigTest, AngleOfTheFirstViewsMustNotExceedThatOfTheOthers) {
  EXPECT_EQ(Faults({"objects.first_view_angle_deg=13"}), "");
  EXPECT_EQ(Faults({"objects.first_view_angle_deg=14"}),
            "--set: objects.first_view_angle_deg = 14 must not exceed objects.view_angle_deg = 13");
}

TEST(ObjectsConfigTest, FirstViewsMustNotExceedAllViews) {
  EXPECT_EQ(Faults({"objects.max_views=4"}), "");
  EXPECT_EQ(Faults({"objects.max_views=3"}), "--set: objects.first_views = 4 must not exceed objects.max_views = 3");
}

}  // namespace romap::objects::objects_config_test
