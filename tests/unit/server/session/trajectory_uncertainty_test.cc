#include "server/session/trajectory_uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>

namespace romap::session::trajectory_uncertainty_test {

TEST(AlignedUncertaintiesTest, SumsTheSources) {
  const FrameUncertainty exact{.reference = {3, 0.3}, .relative = {0, 0}};
  EXPECT_EQ(AlignedUncertainties(std::vector{exact})[0], exact.reference);
  const FrameUncertainty frame{.reference = {3, 0.3}, .relative = {4, 0.4}};
  const PoseUncertainty alone = AlignedUncertainties(std::vector{frame})[0];
  EXPECT_NEAR(alone.position_sigma_mu, std::hypot(5, 2), 1e-12);
  EXPECT_NEAR(alone.rotation_sigma_rad, std::hypot(0.5, 0.2), 1e-12);
}

TEST(AlignedUncertaintiesTest, BadFramesMoveTheAlignmentOfTheOthers) {
  std::vector<FrameUncertainty> frames(4, {.reference = {1, 0.1}, .relative = {0, 0}});
  frames[2].relative = {8, 0.8};
  const std::vector<PoseUncertainty> aligned = AlignedUncertainties(frames);
  EXPECT_NEAR(aligned[0].position_sigma_mu, std::hypot(1, 2), 1e-12);
  EXPECT_NEAR(aligned[0].rotation_sigma_rad, std::hypot(0.1, 0.2), 1e-12);
  EXPECT_NEAR(aligned[2].position_sigma_mu, std::hypot(1, 8, 2), 1e-12);
  EXPECT_TRUE(AlignedUncertainties({}).empty());
}

}  // namespace romap::session::trajectory_uncertainty_test
