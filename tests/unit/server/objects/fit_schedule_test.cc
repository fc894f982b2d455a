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

namespace romap::objects {
namespace {

using ::testing::ElementsAre;

TEST(FitScheduleTest, TheNeediestComeFirst) {
  const FitRequest known{.key = 1, .confirmed = true, .silhouettes = 30, .news = 1, .waiting_frames = 5};
  const FitRequest little_known{.key = 2, .confirmed = true, .silhouettes = 4, .news = 1, .waiting_frames = 5};
  const FitRequest unconfirmed{.key = 3, .confirmed = false, .silhouettes = 4, .news = 1, .waiting_frames = 5};
  const FitRequest long_waiting{.key = 4, .confirmed = true, .silhouettes = 30, .news = 1, .waiting_frames = 500};
  EXPECT_THAT(OrderByNeed({known, little_known, unconfirmed, long_waiting}), ElementsAre(4, 3, 2, 1));
}

TEST(FitScheduleTest, TiesGoToTheOlder) {
  EXPECT_THAT(OrderByNeed({{.key = 9, .silhouettes = 3, .news = 1}, {.key = 4, .silhouettes = 3, .news = 1}}),
              ElementsAre(4, 9));
}

TEST(FitScheduleTest, TheWellKnownWaitForMoreNews) {
  EXPECT_FALSE(IsWorthAFit({.key = 1, .confirmed = true, .silhouettes = 36, .news = 1}));
  EXPECT_TRUE(IsWorthAFit({.key = 1, .confirmed = true, .silhouettes = 36, .news = 4}));
  EXPECT_TRUE(IsWorthAFit({.key = 1, .confirmed = true, .silhouettes = 6, .news = 1}));
}

// News comes for all at every keyframe, and for the unconfirmed ones it is always most of what they have.
TEST(FitScheduleTest, EveryonesTurnComes) {
  constexpr int kObjects = 12;
  constexpr int kFitsPerKeyframe = 2;
  std::map<LandmarkKey, FitRequest> requests;
  for (LandmarkKey key = 1; key <= kObjects; ++key) {
    requests[key] = {.key = key, .confirmed = key % 2 == 0, .silhouettes = key % 2 == 0 ? 36 : 2};
  }
  std::map<LandmarkKey, int> fits;
  for (int keyframe = 0; keyframe < 300; ++keyframe) {
    std::vector<FitRequest> worth;
    for (auto& [key, request] : requests) {
      ++request.news;
      ++request.waiting_frames;
      if (IsWorthAFit(request)) worth.push_back(request);
    }
    const std::vector<LandmarkKey> order = OrderByNeed(worth);
    for (size_t i = 0; i < std::min<size_t>(kFitsPerKeyframe, order.size()); ++i) {
      ++fits[order[i]];
      requests[order[i]].news = 0;
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

// So short a sequence that one fit at a keyframe does not get far: the rest is made up for at the end.
TEST(FitScheduleTest, TheEndLeavesNoneBehind) {
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

}  // namespace
}  // namespace romap::objects
