#include "server/nerf/field_probe.h"

#include <gtest/gtest.h>

#include "server/nerf/model/occupancy.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::field_probe_test {

using testing_support::BallScene;

TEST(FieldProbeTest, LossIsTheWeightedMeanOverTheViews) {
  const ProbeReport report{{{0.1f, 0.2f, 0.2f}, {0.3f, 0.0f, 0.4f}, {9.0f, 9.0f, 9.0f}}};
  EXPECT_NEAR(report.Loss(std::vector<float>{1, 1, 0}), 0.5 * (0.1 + 0.2 + 0.3 + 0.2), 1e-6);
  EXPECT_EQ(report.Loss(std::vector<float>{0, 0, 0}), 0);
}

TEST(FieldProbeTest, MeasuresRaysThatMissTheBoxAndTheResidualOfAnEmptyField) {
  BallScene scene;
  scene.views = 3;
  const std::vector<ObjectView> views = scene.Views();
  const TrainingBox box = TrainingBox::Around(scene.Box(), 0.1);
  NerfConfig config;
  RaySet rays(config, 1);
  rays.Build(views, box);
  FieldProbe probe;
  EXPECT_EQ(probe.ShareIntersectingBox({1, 1, 1}), 1) << "without rays";
  probe.Build(rays, views.size());
  EXPECT_EQ(probe.ShareIntersectingBox({1, 1, 1}), 1);
  EXPECT_LT(probe.ShareIntersectingBox({0.1f, 0.1f, 0.1f}), 0.2);

  Occupancy occupancy(config);
  occupancy.SetHull(std::vector<uint8_t>(occupancy.hull().size(), 0));
  const ProbeReport report = probe.Measure(FieldModel(config, 1), config, {occupancy.bits(), {1, 1, 1}, {}});
  ASSERT_EQ(report.views.size(), 3u);
  for (const ViewResidual& view : report.views) {
    EXPECT_EQ(view.missing, 1);
    EXPECT_EQ(view.spilled, 0);
    EXPECT_GT(view.color, 0.1f);
  }
}

}  // namespace romap::nerf::field_probe_test
