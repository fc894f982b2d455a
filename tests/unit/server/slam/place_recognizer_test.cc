#include "server/slam/place_recognizer.h"

#include <gtest/gtest.h>

#include "tests/unit/server/slam/loop_world.h"

namespace romap::slam::place_recognizer_test {

TEST(PlaceRecognizerTest, RelocalizesAFrameOfTheMap) {
  LoopWorld world(LoopWorld::kKeyframesPerRound, {});
  const MapKeyframe& keyframe = *world.map().FindKeyframe(KeyframeId{9});
  const auto located = world.places().Relocalize(*keyframe.frame);
  ASSERT_TRUE(located);
  EXPECT_LT((located->T_world_camera.translation() - keyframe.center_world()).norm(), 0.02);
}

TEST(PlaceRecognizerTest, DoesNotChooseBetweenPlacesThatLookAlike) {
  LoopWorld world(LoopWorld::kKeyframesPerRound, {}, {.opposite_walls_look_alike = true});
  EXPECT_FALSE(world.places().Relocalize(*world.map().FindKeyframe(KeyframeId{9})->frame));
}

}  // namespace romap::slam::place_recognizer_test
