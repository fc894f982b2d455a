#include "server/objects/object_mapper.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "tests/support/synthetic_world.h"

namespace romap::objects::object_mapper_test {

using ::testing::IsEmpty;
using ::testing::Not;

// All output that the mapper published in a run.
struct Published {
  std::map<ObjectId, ObjectUpdate> objects;
  std::map<ObjectId, std::vector<ObjectView>> views;
  std::map<ObjectId, Cuboid> training_cuboid;
  std::map<ObjectId, int> first_frame;  // frame
  std::vector<std::string> log;         // one line per event
  std::map<ObjectId, int> updates;      // how many
  std::set<ObjectId> removed_ids;
  int merged = 0;
  int lost = 0;
};

void Take(const ObjectOutput& output, int frame, Published* published) {
  for (const MapEvent& event : output.events) {
    if (const auto* update = std::get_if<ObjectUpdate>(&event)) {
      EXPECT_EQ(update->revision, 0u) << "the session's map counts revisions";
      EXPECT_FALSE(published->removed_ids.contains(update->id)) << update->id << " was removed before";
      published->objects[update->id] = *update;
      published->first_frame.try_emplace(update->id, frame);
      published->lost += update->state == ObjectState::kLost ? 1 : 0;
      const Eigen::Vector3d& p = update->cuboid.T_world_object.translation();
      published->log.push_back(fmt::format("{} {} {} {:.9f} {:.9f} {:.9f}", update->id.ToString(),
                                           ++published->updates[update->id], update->class_name, p.x(), p.y(), p.z()));
    } else if (const auto* merge = std::get_if<ObjectMerged>(&event)) {
      EXPECT_EQ(published->objects.erase(merge->from), 1u) << merge->from << " was not published";
      EXPECT_TRUE(published->objects.contains(merge->into)) << merge->into;
      published->removed_ids.insert(merge->from);
      ++published->merged;
    } else if (const auto* removed = std::get_if<ObjectRemoved>(&event)) {
      EXPECT_EQ(published->objects.erase(removed->id), 1u) << removed->id << " was not published";
      published->removed_ids.insert(removed->id);
    }
  }
  for (const ObjectViews& views : output.views) {
    auto& known = published->views[views.object];
    known.insert(known.end(), views.new_views.begin(), views.new_views.end());
    published->training_cuboid[views.object] = views.cuboid;
  }
}

Published MapWorld(const SyntheticWorld& world, ObjectsConfig config = {}) {
  ObjectMapper mapper(config);
  Published published;
  for (int i = 0; i < world.frame_count(); ++i) {
    const TrackedFrame frame = world.MakeFrame(i);
    Take(mapper.ObserveFrame(frame), i, &published);
    if (world.IsKeyframe(i)) Take(mapper.ObserveKeyframe(world.MakeKeyframe(i, frame)), i, &published);
  }
  Take(mapper.Finish(), world.frame_count(), &published);
  return published;
}

// Finds the nearest published object of each true one and checks class, overlap and containment. Returns the mean
// intersection over union; none may be below `min_iou`.
double ExpectFound(const SyntheticWorld& world, const Published& published, double min_iou = 0.45) {
  EXPECT_EQ(published.objects.size(), world.objects().size());
  double iou_sum = 0;
  std::set<ObjectId> used;
  for (int i = 0; i < static_cast<int>(world.objects().size()); ++i) {
    const Cuboid truth = world.TrueCuboid(i);
    const ObjectUpdate* best = nullptr;
    for (const auto& [id, object] : published.objects) {
      const auto distance = [&](const ObjectUpdate& o) {
        return (o.cuboid.T_world_object.translation() - truth.T_world_object.translation()).norm();
      };
      if (best == nullptr || distance(object) < distance(*best)) best = &object;
    }
    if (best == nullptr) continue;
    EXPECT_TRUE(used.insert(best->id).second) << best->id << " is nearest to two objects";
    EXPECT_EQ(best->class_name, world.objects()[static_cast<size_t>(i)].class_name);
    const double iou = CuboidIou(best->cuboid, truth);
    EXPECT_GT(iou, min_iou) << world.objects()[static_cast<size_t>(i)].class_name << " half extents "
                            << best->cuboid.half_extents.transpose() << " instead of "
                            << truth.half_extents.transpose();
    EXPECT_GT(ContainedShare(published.training_cuboid.at(best->id), world.SurfacePoints(i, 2000), 1.1), 0.98)
        << world.objects()[static_cast<size_t>(i)].class_name << " half extents "
        << best->cuboid.half_extents.transpose() << " instead of " << truth.half_extents.transpose();
    iou_sum += iou;
  }
  return iou_sum / static_cast<double>(world.objects().size());
}

TEST(ObjectMapper, FindsEveryObjectOnceWithItsCuboid) {
  const SyntheticWorld world({});
  const Published published = MapWorld(world);
  EXPECT_GT(ExpectFound(world, published), 0.6);
  EXPECT_EQ(published.merged, 0);
}

TEST(ObjectMapper, PublishesTheFirstCuboidAfterAFewDegrees) {
  SyntheticWorldOptions options;
  options.frames = 15;
  options.sweep_deg = 45;
  const Published published = MapWorld(SyntheticWorld(options));
  ASSERT_EQ(published.first_frame.size(), 4u);
  for (const auto& [id, frame] : published.first_frame) EXPECT_LE(frame, 9) << id;
}

TEST(ObjectMapper, IsRobustToNoiseAndOutliers) {
  SyntheticWorldOptions options;
  options.pixel_noise_px = 0.7;
  options.point_noise_mu = 0.003;
  options.outlier_share = 0.15;
  options.mask_jitter_px = 1;
  const SyntheticWorld world(options);
  EXPECT_GT(ExpectFound(world, MapWorld(world)), 0.6);
}

TEST(ObjectMapper, IsRobustToMissingMasksAndWrongClasses) {
  SyntheticWorldOptions options;
  options.dropped_mask_share = 0.3;
  options.wrong_class_share = 0.3;
  const SyntheticWorld world(options);
  EXPECT_GT(ExpectFound(world, MapWorld(world)), 0.6);
}

TEST(ObjectMapper, MapsTexturelessObjectsFromMasksAlone) {
  SyntheticWorldOptions options;
  options.textureless = {0, 1, 2, 3};
  const SyntheticWorld world(options);
  // Only the elevation of the cameras bounds a flat top, so that the book becomes twice as thick.
  EXPECT_GT(ExpectFound(world, MapWorld(world), 0.35), 0.5);
}

TEST(ObjectMapper, SeparatesIdenticalNeighbors) {
  SyntheticWorldOptions options;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d center(0.13 * i - 0.2, 0.02 * i, 0.06);
    options.objects.push_back({"cup", SyntheticShape::kEllipsoid, center, {0.05, 0.05, 0.06}, 0});
  }
  const SyntheticWorld world(options);
  EXPECT_GT(ExpectFound(world, MapWorld(world)), 0.6);
}

// The frame of a client that does not wait for its detector.
TrackedFrame WithoutMasks(TrackedFrame tracked) {
  auto frame = std::make_shared<Frame>(*tracked.frame);
  frame->has_masks = false;
  frame->labels.release();
  frame->instances.clear();
  tracked.frame = frame;
  return tracked;
}

// Masks arrive for every `every`-th frame only, `late` frames later.
Published MapWithSlowDetector(const SyntheticWorld& world, int every, int late) {
  ObjectMapper mapper({});
  Published published;
  for (int i = 0; i < world.frame_count() + late; ++i) {
    if (i < world.frame_count()) {
      TrackedFrame full = world.MakeFrame(i);
      full.is_keyframe = world.IsKeyframe(i);
      const bool on_time = late == 0 && i % every == 0;
      const TrackedFrame frame = on_time ? full : WithoutMasks(full);
      Take(mapper.ObserveFrame(frame), i, &published);
      if (full.is_keyframe) {
        KeyframeView view = world.MakeKeyframe(i, full);
        view.frame = frame.frame;
        if (!on_time) {
          for (PointObservation& seen : view.observations) seen.label = 0;
        }
        Take(mapper.ObserveKeyframe(view), i, &published);
      }
    }
    const int masked = i - late;
    if (late == 0 || masked < 0 || masked % every != 0) continue;
    const TrackedFrame then = world.MakeFrame(masked);
    Take(mapper.ObserveLateMasks({then.frame->frame_id, then.frame->labels, then.frame->instances}), i, &published);
  }
  Take(mapper.Finish(), world.frame_count(), &published);
  return published;
}

TEST(ObjectMapper, MasksOnSomeFramesThatAreNotKeyframesSuffice) {
  SyntheticWorldOptions options;
  options.frames = 150;
  options.keyframe_every = 6;
  const SyntheticWorld world(options);
  EXPECT_GT(ExpectFound(world, MapWithSlowDetector(world, /*every=*/5, /*late=*/0)), 0.6);
}

TEST(ObjectMapper, LateMasksGiveAnEquallyGoodMap) {
  const SyntheticWorld world({});
  const Published on_time = MapWithSlowDetector(world, 1, 0);
  const Published late = MapWithSlowDetector(world, 1, 12);
  const double iou = ExpectFound(world, on_time);
  EXPECT_GT(iou, 0.85);
  EXPECT_GT(ExpectFound(world, late), 0.8) << "late labels are less exact, so that fewer points have an owner";
}

TEST(ObjectMapper, LateMasksOnSomeFramesSuffice) {
  SyntheticWorldOptions options;
  options.frames = 150;
  options.keyframe_every = 6;
  const SyntheticWorld world(options);
  EXPECT_GT(ExpectFound(world, MapWithSlowDetector(world, /*every=*/5, /*late=*/12)), 0.6);
}

TEST(ObjectMapper, MatchesAnObjectThatWasOutOfViewForALongTime) {
  SyntheticWorldOptions options;
  options.frames = 120;
  options.sweep_deg = 240;
  options.away_frames = {{40, 90}};
  const SyntheticWorld world(options);
  const Published published = MapWorld(world);
  EXPECT_GT(ExpectFound(world, published), 0.6);
  EXPECT_EQ(published.lost, 0) << "an object that is out of view is not lost";
}

TEST(ObjectMapper, DoesNotPublishShortFalseDetections) {
  SyntheticWorldOptions options;
  options.false_detections = {{10, {20, 20, 40, 40}}, {11, {22, 20, 40, 40}}, {30, {250, 150, 30, 60}}};
  const SyntheticWorld world(options);
  const Published published = MapWorld(world);
  ExpectFound(world, published);
  for (const auto& [id, object] : published.objects) EXPECT_NE(object.class_name, kFalseDetectionClass);
}

TEST(ObjectMapper, RemovesObjectsOfPosesThatContradictTheImages) {
  const SyntheticWorld world({});
  for (const uint64_t since_frame : {world.MakeFrame(0).frame->frame_id, world.MakeFrame(40).frame->frame_id}) {
    ObjectMapper mapper{ObjectsConfig{}};
    Published published;
    for (int i = 0; i < 50; ++i) {
      const TrackedFrame frame = world.MakeFrame(i);
      Take(mapper.ObserveFrame(frame), i, &published);
      if (world.IsKeyframe(i)) Take(mapper.ObserveKeyframe(world.MakeKeyframe(i, frame)), i, &published);
    }
    ASSERT_THAT(published.objects, Not(IsEmpty()));
    TrackedFrame refused = world.MakeFrame(50);
    refused.state = TrackingState::kLost;
    refused.contradicted_since_frame = since_frame;
    Take(mapper.ObserveFrame(refused), 50, &published);
    Take(mapper.Finish(), 51, &published);
    // Objects that were known before the contradiction began remain.
    EXPECT_EQ(published.objects.empty(), since_frame == world.MakeFrame(0).frame->frame_id) << since_frame;
  }
}

TEST(ObjectMapper, PublishesUnconfirmedObjectsAsProvisionalWithoutTraining) {
  SyntheticWorldOptions options;
  // A false detection that persists for some frames.
  for (int i = 6; i < 11; ++i) options.false_detections.push_back({i, {20 + 2 * i, 190, 30, 30}});
  const SyntheticWorld world(options);
  ObjectMapper mapper({});
  Published published;
  std::map<ObjectId, ObjectState> first_state;
  for (int i = 0; i < world.frame_count(); ++i) {
    const TrackedFrame frame = world.MakeFrame(i);
    std::vector<ObjectOutput> outputs = {mapper.ObserveFrame(frame)};
    if (world.IsKeyframe(i)) outputs.push_back(mapper.ObserveKeyframe(world.MakeKeyframe(i, frame)));
    for (const ObjectOutput& output : outputs) {
      Take(output, i, &published);
      for (const MapEvent& event : output.events) {
        if (const auto* update = std::get_if<ObjectUpdate>(&event)) first_state.try_emplace(update->id, update->state);
      }
      for (const ObjectViews& views : output.views) {
        EXPECT_NE(published.objects.at(views.object).state, ObjectState::kProvisional);
        EXPECT_FALSE(views.S_new_old) << "nothing was corrected";
      }
    }
  }
  const auto is_provisional = [](const auto& first) { return first.second == ObjectState::kProvisional; };
  EXPECT_GE(std::count_if(first_state.begin(), first_state.end(), is_provisional), 3);
  EXPECT_GE(first_state.size(), 5u) << "including the false detection";
  Take(mapper.Finish(), world.frame_count(), &published);
  for (const auto& [id, object] : published.objects)
    EXPECT_EQ(object.state, ObjectState::kConfirmed) << object.class_name;
  EXPECT_EQ(published.objects.size(), 4u);
}

TEST(ObjectMapper, TheUpDirectionMayDifferFromZ) {
  SyntheticWorldOptions options;
  options.up_world = {0.3, -0.9, 0.2};
  const SyntheticWorld world(options);
  const Published published = MapWorld(world);
  EXPECT_GT(ExpectFound(world, published), 0.6);
  for (const auto& [id, object] : published.objects) {
    EXPECT_GT(object.cuboid.T_world_object.RotationMatrix().col(2).dot(options.up_world.normalized()), 0.9999) << id;
  }
}

TEST(ObjectMapper, IsDeterministic) {
  SyntheticWorldOptions options;
  options.frames = 30;
  options.outlier_share = 0.1;
  const SyntheticWorld world(options);
  const Published first = MapWorld(world);
  EXPECT_THAT(first.log, Not(IsEmpty()));
  EXPECT_EQ(first.log, MapWorld(world).log);
}

TEST(ObjectMapper, ReportsARemovedObjectAsLost) {
  SyntheticWorldOptions options;
  options.frames = 60;
  const SyntheticWorld with(options);
  options.objects = DefaultSyntheticObjects();
  options.objects.erase(options.objects.begin() + 1);
  const SyntheticWorld without(options);
  ObjectsConfig config;
  config.lost_after_frames = 20;
  ObjectMapper mapper(config);
  Published published;
  for (int i = 0; i < 120; ++i) {
    const SyntheticWorld& world = i < 60 ? with : without;
    TrackedFrame frame = world.MakeFrame(i % 60);
    Take(mapper.ObserveFrame(frame), i, &published);
    if (world.IsKeyframe(i)) Take(mapper.ObserveKeyframe(world.MakeKeyframe(i % 60, frame)), i, &published);
  }
  EXPECT_EQ(published.lost, 1);
  EXPECT_EQ(published.objects.size(), 4u) << "a lost object stays in the map";
}

TEST(ObjectMapper, PublishesOnlyNoticeableChanges) {
  SyntheticWorldOptions options;
  options.frames = 90;
  options.mask_jitter_px = 1;
  const Published published = MapWorld(SyntheticWorld(options));
  for (const auto& [id, updates] : published.updates) EXPECT_LE(updates, 20) << id << " of 30 keyframes";
}

TEST(ObjectMapper, IgnoresInvalidInput) {
  const SyntheticWorld world({});
  ObjectMapper mapper({});
  TrackedFrame frame = world.MakeFrame(0);

  TrackedFrame nothing;
  EXPECT_THAT(mapper.ObserveFrame(nothing).events, IsEmpty());
  KeyframeView no_keyframe;
  EXPECT_THAT(mapper.ObserveKeyframe(no_keyframe).events, IsEmpty());

  TrackedFrame bad_pose = frame;
  bad_pose.T_world_camera = {Eigen::Quaterniond::Identity(),
                             Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN())};
  EXPECT_THAT(mapper.ObserveFrame(bad_pose).events, IsEmpty());

  Frame broken = *frame.frame;
  broken.labels = cv::Mat::ones(10, 10, CV_16UC1);
  frame.frame = std::make_shared<Frame>(broken);
  EXPECT_THAT(mapper.ObserveFrame(frame).events, IsEmpty());
  broken.labels = cv::Mat::ones(broken.image_bgr.size(), CV_16UC1);  // one mask that covers the image
  frame.frame = std::make_shared<Frame>(broken);
  for (int i = 0; i < 10; ++i) {
    mapper.ObserveFrame(frame);
    KeyframeView view = world.MakeKeyframe(0, frame);
    for (MapPoint& point : view.points) point.position_world.setConstant(std::numeric_limits<double>::infinity());
    EXPECT_THAT(mapper.ObserveKeyframe(view).events, IsEmpty());
  }
  broken.labels.release();
  frame.frame = std::make_shared<Frame>(broken);
  EXPECT_THAT(mapper.ObserveFrame(frame).events, IsEmpty());
  EXPECT_THAT(mapper.Finish().events, IsEmpty());

  // The mapper still works.
  Published published;
  for (int i = 0; i < world.frame_count(); ++i) {
    const TrackedFrame good = world.MakeFrame(i);
    Take(mapper.ObserveFrame(good), i, &published);
    if (world.IsKeyframe(i)) Take(mapper.ObserveKeyframe(world.MakeKeyframe(i, good)), i, &published);
  }
  ExpectFound(world, published);
}

TEST(ObjectMapper, ViewsCoverAllDirectionsAndClassifyRays) {
  SyntheticWorldOptions options;
  options.with_depth = true;
  const SyntheticWorld world(options);
  const Published published = MapWorld(world);
  ASSERT_EQ(published.views.size(), 4u);
  for (const auto& [id, views] : published.views) {
    EXPECT_GE(views.size(), 17u) << id;
    EXPECT_LE(views.size(), 30u) << id;
    const Cuboid& cuboid = published.objects.at(id).cuboid;
    EXPECT_TRUE((published.training_cuboid.at(id).half_extents.array() > 0.97 * cuboid.half_extents.array()).all());
    std::set<KeyframeId> keyframes;
    for (const ObjectView& view : views) {
      EXPECT_EQ(view.object, id);
      EXPECT_TRUE(keyframes.insert(view.keyframe).second) << view.keyframe << " twice";
      EXPECT_EQ(view.color_bgr.size(), view.roi_px.size());
      EXPECT_EQ(view.ray_kind.size(), view.roi_px.size());
      EXPECT_EQ(view.depth_mu.size(), view.roi_px.size());
      EXPECT_FALSE(view.sparse_depth.empty());
      const Eigen::Vector3d center = view.T_world_camera.Inverse() * cuboid.T_world_object.translation();
      const Eigen::Vector2d pixel = view.camera.Project(center);
      const cv::Point inside(static_cast<int>(pixel.x()) - view.roi_px.x, static_cast<int>(pixel.y()) - view.roi_px.y);
      ASSERT_TRUE(cv::Rect({}, view.roi_px.size()).contains(inside));
      EXPECT_NE(view.ray_kind.at<uint8_t>(inside), static_cast<uint8_t>(RayKind::kBackground));
      for (const Eigen::Vector3f& sparse : view.sparse_depth) {
        EXPECT_NEAR(sparse.z(), center.z(), 0.35);
      }
    }
  }
}

}  // namespace romap::objects::object_mapper_test
