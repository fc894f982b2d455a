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
  for (size_t i = 0; i < 4; ++i) frames[i].position_world = {i < 2 ? 1e6 : -1e6, i % 2 == 0 ? 1e6 : -1e6, 0};
  frames[2].relative = {8, 0.8};
  const std::vector<PoseUncertainty> aligned = AlignedUncertainties(frames);
  EXPECT_NEAR(aligned[0].position_sigma_mu, std::hypot(1, 2), 1e-12);
  EXPECT_NEAR(aligned[0].rotation_sigma_rad, std::hypot(0.1, 0.2), 1e-6);
  EXPECT_NEAR(aligned[2].position_sigma_mu, std::hypot(1, 8, 2), 1e-12);
  EXPECT_TRUE(AlignedUncertainties({}).empty());
}

TEST(AlignedUncertaintiesTest, PositionsNearALineLeaveTheRotationAboutIt) {
  std::vector<FrameUncertainty> frames(100, {.reference = {0.001, 0.001}, .relative = {0.01, 0.001}});
  for (size_t i = 0; i < frames.size(); ++i) frames[i].position_world = {0.1 * static_cast<double>(i), 0, 0};
  EXPECT_GT(AlignedUncertainties(frames)[0].rotation_sigma_rad, 0.9) << "exactly on a line";
  for (size_t i = 0; i < frames.size(); ++i) frames[i].position_world.y() = i % 2 == 0 ? 0.1 : -0.1;
  const double near_line = AlignedUncertainties(frames)[0].rotation_sigma_rad;
  EXPECT_NEAR(near_line, 0.7011 * 0.01 / 4 / 0.1, 0.001);
  for (size_t i = 0; i < frames.size(); ++i) frames[i].position_world.y() *= 10;
  EXPECT_LT(AlignedUncertainties(frames)[0].rotation_sigma_rad, 0.2 * near_line);
}

}  // namespace romap::session::trajectory_uncertainty_test
