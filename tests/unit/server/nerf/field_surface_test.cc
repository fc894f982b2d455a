#include "server/nerf/field_surface.h"

#include <gtest/gtest.h>

#include <cmath>

namespace romap::nerf::field_surface_test {

TEST(FieldSurfaceTest, DescribesDensityAndDistanceFields) {
  NerfConfig config;
  TrainingBox box;
  box.unit_mu = 2;
  FieldModel model(config, 1);
  FieldSnapshot snapshot;
  DescribeSurface(config, model, box, snapshot);
  EXPECT_FLOAT_EQ(snapshot.surface_level, static_cast<float>(config.surface_level));
  EXPECT_FLOAT_EQ(snapshot.connect_level, static_cast<float>(config.surface_level - 2));
  EXPECT_NEAR(snapshot.optics.surface_density_per_mu, std::exp(config.surface_level) / 2, 1e-4);
  EXPECT_EQ(snapshot.optics.raw_per_efold, 1);
  config.field = "sdf";
  model = FieldModel(config, 1);
  model.sharpness = 100;
  DescribeSurface(config, model, box, snapshot);
  EXPECT_EQ(snapshot.surface_level, 0);
  EXPECT_FLOAT_EQ(snapshot.optics.surface_density_per_mu, 25);
  EXPECT_FLOAT_EQ(snapshot.optics.raw_per_efold, 0.1f);
  EXPECT_LT(snapshot.connect_level, 0);
}

}  // namespace romap::nerf::field_surface_test
