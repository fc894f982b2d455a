// Objects whose fields need the general kernels: frequency encoding, or several hidden layers.
#include <gtest/gtest.h>

#include "server/nerf/object_field.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::general_field_test {

ObjectField TrainedBall(const testing_support::BallScene& scene, const NerfConfig& config, int threads) {
  ObjectField field(config, scene.object, 1);
  EXPECT_TRUE(field.SetBox(scene.Box()).ok());
  for (const ObjectView& view : scene.Views()) EXPECT_TRUE(field.AddView(view).ok());
  field.Train(150, threads);
  return field;
}

// The whole training of two baselines: frequency encoding with a deep MLP, and a hash grid with a deep MLP.
TEST(GeneralFieldTest, LearnsTheShapeOfABall) {
  testing_support::BallScene scene;
  scene.with_depth = true;
  NerfConfig frequency;
  frequency.encoding = "frequency";
  frequency.levels = 5;
  frequency.hidden_layers = 4;
  frequency.learning_rate = 0.003;
  frequency.contrast_weight = 0;  // the baselines have none
  EXPECT_LT(testing_support::BallSurfaceError(scene, TrainedBall(scene, frequency, 1).Snapshot()), 0.1);
  NerfConfig deep;
  deep.hidden_layers = 3;
  deep.learning_rate = 0.005;
  deep.contrast_weight = 0;
  EXPECT_LT(testing_support::BallSurfaceError(scene, TrainedBall(scene, deep, 1).Snapshot()), 0.1);
}

TEST(GeneralFieldTest, IsDeterministicOnTwoThreads) {
  const testing_support::BallScene scene;
  NerfConfig config;
  config.encoding = "frequency";
  config.hidden_layers = 2;
  EXPECT_EQ(testing_support::RawOnGrid(TrainedBall(scene, config, 2).Snapshot()),
            testing_support::RawOnGrid(TrainedBall(scene, config, 2).Snapshot()));
}

}  // namespace romap::nerf::general_field_test
