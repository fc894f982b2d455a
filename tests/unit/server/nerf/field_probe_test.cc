#include "server/nerf/field_probe.h"

#include <gtest/gtest.h>

#include "server/nerf/cpu/occupancy.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf {
namespace {

using testing::BallScene;

TEST(FieldProbeTest, LossIsTheMeanOverTheViewsThatCount) {
  const ProbeReport report{{{0.1f, 0.2f, 0.2f}, {0.3f, 0.0f, 0.4f}, {9.0f, 9.0f, 9.0f}}, {}};
  EXPECT_NEAR(report.Loss(std::vector<float>{1, 1, 0}), 0.5 * (0.1 + 0.2 + 0.3 + 0.2), 1e-6);
  EXPECT_EQ(report.Loss(std::vector<float>{0, 0, 0}), 0);
}

TEST(FieldProbeTest, NeedFollowsTheResidualButLeavesSomeToAll) {
  ProbeReport report;
  report.tiles = {0.1f, 0.1f, 0.1f, 0.5f, 0.0f};  // 0: a tile without pixels
  const std::vector<float> need = report.NeedOfTiles(0.5);
  EXPECT_NEAR(need[0], 0.5 + 0.5 * 0.5, 1e-5);
  EXPECT_NEAR(need[3], 0.5 + 0.5 * 2.5, 1e-5);
  for (float n : report.NeedOfTiles(0)) EXPECT_EQ(n, 1);
  report.tiles = std::vector<float>(100, 0.001f);
  report.tiles[7] = 50;
  EXPECT_NEAR(report.NeedOfTiles(1)[7], 4, 1e-5) << "one tile cannot take all";
}

TEST(FieldProbeTest, SeesWhichRaysMeetTheBoxAndHowAnEmptySpaceDiffersFromTheViews) {
  testing::BallScene scene;
  scene.views = 3;
  const std::vector<ObjectView> views = scene.Views();
  const TrainingBox box = TrainingBox::Around(scene.Box(), 0.1);
  NerfConfig config;
  RaySet rays(config, 1);
  rays.Build(views, box);
  FieldProbe probe;
  EXPECT_EQ(probe.ShareMeeting({1, 1, 1}), 1) << "without rays";
  probe.Build(rays, views.size());
  EXPECT_EQ(probe.ShareMeeting({1, 1, 1}), 1);
  EXPECT_LT(probe.ShareMeeting({0.1f, 0.1f, 0.1f}), 0.2);

  nerf::Occupancy occupancy(config);
  occupancy.SetHull(std::vector<uint8_t>(occupancy.hull().size(), 0));
  const ProbeReport report = probe.Look(nerf::FieldModel(config, 1), config, {occupancy.bits(), {1, 1, 1}, {}});
  ASSERT_EQ(report.views.size(), 3u);
  for (const ViewResidual& view : report.views) {
    EXPECT_EQ(view.missing, 1);
    EXPECT_EQ(view.spilled, 0);
    EXPECT_GT(view.color, 0.1f);
  }
}

}  // namespace
}  // namespace romap::nerf
