#include "server/nerf/field_warnings.h"

#include <gtest/gtest.h>

namespace romap::nerf::field_warnings_test {

TEST(FieldWarningsTest, IsEmptyWithoutProblems) {
  FieldWarnings warnings;
  warnings.OnBox(absl::OkStatus());
  warnings.OnViewChecks({.views = 5, .mask_border_px = 3});
  EXPECT_EQ(warnings.Text(0, {}), "");
}

TEST(FieldWarningsTest, ListsAllProblems) {
  FieldWarnings warnings;
  warnings.OnInvalidCorrection();
  warnings.OnBox(absl::InvalidArgumentError("cuboid: pose is not finite"));
  warnings.OnRejectedView(absl::InvalidArgumentError("first"));
  warnings.OnRejectedView(absl::InvalidArgumentError("second"));
  warnings.OnViewChecks(
      {.views = 9, .black_views = 2, .mask_border_px = 4, .depth_consistent = false, .share_intersecting_box = 0.4});
  EXPECT_EQ(warnings.Text(3, {KeyframeId{4}, KeyframeId{7}}),
            "training diverged 3 times; paused until new data arrives; "
            "a map correction with values that are not finite was ignored; "
            "cuboid: pose is not finite; "
            "2 views rejected; last error: second; "
            "the object is black in 2 of 9 views; "
            "the masks are imprecise: their borders are uncertain by 4 px; "
            "depth images ignored because they contradict the masks; "
            "most rays through the masks miss the object's box; "
            "views excluded because they contradict the others: keyframe/4, keyframe/7");
}

TEST(FieldWarningsTest, AValidBoxClearsTheWarningOfTheLastOne) {
  FieldWarnings warnings;
  warnings.OnBox(absl::InvalidArgumentError("cuboid: pose is not finite"));
  warnings.OnBox(absl::OkStatus());
  EXPECT_EQ(warnings.Text(0, {}), "");
}

}  // namespace romap::nerf::field_warnings_test
