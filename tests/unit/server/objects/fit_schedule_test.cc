#include "server/objects/fit_schedule.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "server/objects/object_mapper.h"
#include "tests/support/synthetic_world.h"

namespace romap::objects::fit_schedule_test {

using ::testing::ElementsAre;

TEST(FitScheduleTest, OrdersByUrgency) {
  const FitRequest well_known{.key = 1, .confirmed = true, .silhouettes = 30, .changed = 1, .waiting_frames = 5};
  const FitRequest little_known{.key = 2, .confirmed = true, .silhouettes = 4, .changed = 1, .waiting_frames = 5};
  const FitRequest unconfirmed{.key = 3, .confirmed = false, .silhouettes = 4, .changed = 1, .waiting_frames = 5};
  const FitRequest long_waiting{.key = 4, .confirmed = true, .silhouettes = 30, .changed = 1, .waiting_frames = 500};
  EXPECT_THAT(OrderByUrgency({well_known, little_known, unconfirmed, long_waiting}), ElementsAre(4, 3, 2, 1));
}

TEST(FitScheduleTest, TheOlderOfEquallyUrgentLandmarksComesFirst) {
  EXPECT_THAT(OrderByUrgency({{.key = 9, .silhouettes = 3, .changed = 1}, {.key = 4, .silhouettes = 3, .changed = 1}}),
              ElementsAre(4, 9));
}

TEST(FitScheduleTest, LandmarksWithManySilhouettesNeedMoreChanges) {
  EXPECT_FALSE(IsDueForFit({.key = 1, .confirmed = true, .silhouettes = 36, .changed = 1}));
  EXPECT_TRUE(IsDueForFit({.key = 1, .confirmed = true, .silhouettes = 36, .changed = 4}));
  EXPECT_TRUE(IsDueForFit({.key = 1, .confirmed = true, .silhouettes = 6, .changed = 1}));
}

// Every landmark gets a silhouette at every keyframe. For unconfirmed ones this is a large share of all their
// silhouettes.
TEST(FitScheduleTest, EveryLandmarkIsFittedEventually) {
  constexpr int kObjects = 12;
  constexpr int kFitsPerKeyframe = 2;
  std::map<LandmarkKey, FitRequest> requests;
  for (LandmarkKey key = 1; key <= kObjects; ++key) {
    requests[key] = {.key = key, .confirmed = key % 2 == 0, .silhouettes = key % 2 == 0 ? 36 : 2};
  }
  std::map<LandmarkKey, int> fits;
  for (int keyframe = 0; keyframe < 300; ++keyframe) {
    std::vector<FitRequest> due;
    for (auto& [key, request] : requests) {
      ++request.changed;
      ++request.waiting_frames;
      if (IsDueForFit(request)) due.push_back(request);
    }
    const std::vector<LandmarkKey> order = OrderByUrgency(due);
    for (size_t i = 0; i < std::min<size_t>(kFitsPerKeyframe, order.size()); ++i) {
      ++fits[order[i]];
      requests[order[i]].changed = 0;
      requests[order[i]].waiting_frames = 0;
    }
  }
  for (LandmarkKey key = 1; key <= kObjects; ++key) EXPECT_GE(fits[key], 5) << key;
}

struct Boxes {
  std::map<ObjectId, Cuboid> cuboids;
  std::vector<std::string> log;
};

Boxes Map(const SyntheticWorld& world, int cuboid_fits_per_keyframe) {
  ObjectsConfig config;
  config.cuboid_fits_per_keyframe = cuboid_fits_per_keyframe;
  ObjectMapper mapper(config);
  Boxes boxes;
  const auto take = [&](const ObjectOutput& output) {
    for (const MapEvent& event : output.events) {
      const auto* update = std::get_if<ObjectUpdate>(&event);
      if (update == nullptr) continue;
      boxes.cuboids[update->id] = update->cuboid;
      boxes.log.push_back(update->id.ToString() + " " + std::to_string(update->cuboid.half_extents.sum()));
    }
  };
  for (int i = 0; i < world.frame_count(); ++i) {
    const TrackedFrame frame = world.MakeFrame(i);
    take(mapper.ObserveFrame(frame));
    if (world.IsKeyframe(i)) take(mapper.ObserveKeyframe(world.MakeKeyframe(i, frame)));
  }
  take(mapper.Finish());
  return boxes;
}

// In a short sequence one fit per keyframe does not reach every landmark.
TEST(FitScheduleTest, FinishFitsAllRemainingLandmarks) {
  SyntheticWorldOptions options;
  options.frames = 18;
  options.sweep_deg = 90;
  const SyntheticWorld world(options);
  const Boxes boxes = Map(world, 1);
  ASSERT_EQ(boxes.cuboids.size(), world.objects().size());
  for (int i = 0; i < static_cast<int>(world.objects().size()); ++i) {
    double best = 0;
    for (const auto& [id, cuboid] : boxes.cuboids) best = std::max(best, CuboidIou(cuboid, world.TrueCuboid(i)));
    EXPECT_GT(best, 0.45) << world.objects()[static_cast<size_t>(i)].class_name;
  }
}

TEST(FitScheduleTest, IsDeterministic) {
  SyntheticWorldOptions options;
  options.frames = 18;
  EXPECT_EQ(Map(SyntheticWorld(options), 1).log, Map(SyntheticWorld(options), 1).log);
}

}  // namespace romap::objects::fit_schedule_test
