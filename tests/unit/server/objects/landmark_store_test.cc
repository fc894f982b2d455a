#include "server/objects/landmark_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <memory>

namespace romap::objects::landmark_store_test {

using ::testing::ElementsAre;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

constexpr KeyframeId kKeyframe{1};
constexpr uint16_t kLabel = 5;

class LandmarkStoreTest : public ::testing::Test {
 protected:
  // A landmark with a cuboid at the origin that was observed in kKeyframe.
  Landmark& AddLandmark() {
    Landmark& landmark = store_.Create();
    landmark.keyframes = {kKeyframe};
    landmark.geometry.cuboid = Cuboid{.T_world_object = {}, .half_extents = Eigen::Vector3d::Constant(0.1)};
    landmark.geometry.training_box = landmark.geometry.cuboid;
    landmark.geometry.body_world = {{0.05, 0, 0}};
    return landmark;
  }

  // A frame in which these landmarks have a mask.
  static FrameDetections FrameOf(const std::vector<LandmarkKey>& keys) {
    FrameDetections frame{.usable = true, .frame_id = 1, .detections = {}, .keys = keys, .unambiguous = {}};
    for (size_t i = 0; i < keys.size(); ++i) {
      Detection detection;
      detection.label = static_cast<uint16_t>(kLabel + i);
      detection.class_name = "cup";
      frame.detections.push_back(detection);
      frame.unambiguous.push_back(true);
    }
    return frame;
  }

  ObjectsConfig config_;
  LandmarkStore store_{config_};
};

TEST_F(LandmarkStoreTest, NewLandmarksAreProvisionalAndHaveNewKeys) {
  const LandmarkKey first = store_.Create().key;
  const LandmarkKey second = store_.Create().key;
  EXPECT_THAT(store_.Keys(), ElementsAre(first, second));
  EXPECT_EQ(store_.Find(second)->state, ObjectState::kProvisional);
  store_.RemoveIf([&](const Landmark& landmark) { return landmark.key == second; });
  EXPECT_EQ(store_.Find(second), nullptr);
  EXPECT_EQ(store_.Find(kNoLandmark), nullptr);
  EXPECT_GT(store_.Create().key, second) << "keys are never reused";
}

TEST_F(LandmarkStoreTest, LandmarksAndPointsOfOtherMapsAreDormant) {
  const SparseMapId first{1}, second{2};
  const MapPointId point{3};
  store_.SetMap(first, 1);
  const LandmarkKey key = AddLandmark().key;
  KeyframeView view;
  view.points = {{.id = point, .position_world = {1, 2, 3}}};
  store_.UpdatePoints(view);

  store_.SetMap(second, 10);
  EXPECT_TRUE(store_.landmarks().empty());
  EXPECT_EQ(store_.Find(key), nullptr);
  EXPECT_EQ(store_.points().Find(point), nullptr);
  ASSERT_EQ(store_.DormantLandmarks().size(), 1U);
  EXPECT_EQ(store_.DormantLandmarks()[0]->key, key);
  const LandmarkKey other = AddLandmark().key;
  EXPECT_EQ(store_.Find(other)->map, second);
  EXPECT_THAT(store_.Maps(), ElementsAre(first, second));

  store_.SetMap(first, 60);
  EXPECT_THAT(store_.Keys(), ElementsAre(key));
  EXPECT_NE(store_.points().Find(point), nullptr);
  EXPECT_EQ(store_.Find(key)->evidence.dormant_frames, 50U);
  EXPECT_THAT(store_.Maps(), ElementsAre(second, first));
}

TEST_F(LandmarkStoreTest, ADormantLandmarkMovesOnlyWithItsKeyframes) {
  store_.SetMap(SparseMapId{1}, 1);
  Landmark& landmark = AddLandmark();
  store_.SetMap(SparseMapId{2}, 2);
  store_.SetUp({0, 1, 0});
  const Cuboid before = *landmark.geometry.cuboid;
  EXPECT_FALSE(store_.Correct(landmark, {}));
  EXPECT_EQ(landmark.geometry.cuboid->T_world_object.Matrix(), before.T_world_object.Matrix());
  const Sim3<World, World> S(2, Eigen::Quaterniond::Identity(), {1, 0, 0});
  EXPECT_TRUE(store_.Correct(landmark, {{kKeyframe, {kKeyframe, {}, S}}}));
  EXPECT_EQ(landmark.geometry.cuboid->T_world_object.translation(), Eigen::Vector3d(1, 0, 0));
}

TEST_F(LandmarkStoreTest, MergedMapsShareTheirLandmarks) {
  const SparseMapId first{1}, second{2}, third{3};
  store_.SetMap(first, 1);
  const LandmarkKey a = AddLandmark().key;
  store_.SetMap(second, 2);
  const LandmarkKey b = AddLandmark().key;
  store_.SetMap(third, 3);
  const LandmarkKey c = AddLandmark().key;
  store_.MergeMaps({.from = second, .into = first}, 4);
  EXPECT_EQ(store_.map(), third);
  EXPECT_THAT(store_.Keys(), ElementsAre(c));
  for (const Landmark* landmark : store_.DormantLandmarks()) EXPECT_EQ(landmark->map, first);
  store_.MergeMaps({.from = third, .into = first}, 5);
  EXPECT_EQ(store_.map(), first);
  EXPECT_THAT(store_.Keys(), UnorderedElementsAre(a, b, c));
  for (const auto& landmark : store_.landmarks()) EXPECT_EQ(landmark->map, first);
  EXPECT_TRUE(store_.DormantLandmarks().empty());
}

TEST_F(LandmarkStoreTest, PointsBelongToTheLandmarkOfTheirMaskOrToTheBackground) {
  const LandmarkKey key = AddLandmark().key;
  auto image = std::make_shared<Frame>();
  image->camera = {.width_px = 600, .height_px = 10};
  image->labels = cv::Mat::zeros(10, 600, CV_16UC1);
  image->labels(cv::Rect(0, 0, 10, 10)) = kLabel;
  KeyframeView view;
  view.frame = image;
  for (uint64_t id = 1; id <= 5; ++id) view.points.push_back({.id = MapPointId{id}, .position_world = {0, 0, 1}});
  view.observations = {{.point = MapPointId{1}, .pixel_px = {4, 4}, .label = kLabel},
                       {.point = MapPointId{2}, .pixel_px = {35, 4}, .label = 0},
                       {.point = MapPointId{3}, .pixel_px = {9, 4}, .label = 0},  // at the border of the mask
                       {.point = MapPointId{4}, .pixel_px = {4, 4}, .label = 99},
                       {.point = MapPointId{5}, .pixel_px = {15, 4}, .label = 0}};  // a corner of its outline
  store_.UpdatePoints(view);
  store_.CountPointVotes(view, FrameOf({key}));
  const auto groups = store_.points().GroupByOwner();
  ASSERT_EQ(groups.size(), 3u) << "points 3 and 4 have no owner";
  ASSERT_EQ(groups.at(key).size(), 1u);
  EXPECT_EQ(groups.at(key)[0].id, MapPointId{1});
  ASSERT_EQ(groups.at(kBackgroundKey).size(), 1u);
  EXPECT_EQ(groups.at(kBackgroundKey)[0].id, MapPointId{2});
  ASSERT_EQ(groups.at(kOutlineKey).size(), 1u);
  EXPECT_EQ(groups.at(kOutlineKey)[0].id, MapPointId{5});
}

TEST(PointRegistryTest, APointThatIsOftenClearOfMasksBelongsToTheBackground) {
  constexpr LandmarkKey kObject = 7;
  PointRegistry registry;
  KeyframeView view;
  for (uint64_t id = 1; id <= 4; ++id) view.points.push_back({.id = MapPointId{id}, .position_world = {0, 0, 1}});
  registry.UpdatePositions(view);
  const auto vote = [&](uint64_t id, int inside, int outline, int background) {
    for (int i = 0; i < inside; ++i) registry.Vote(MapPointId{id}, kObject);
    for (int i = 0; i < outline; ++i) registry.Vote(MapPointId{id}, kOutlineKey);
    for (int i = 0; i < background; ++i) registry.Vote(MapPointId{id}, kBackgroundKey);
  };
  vote(1, 0, 3, 4);
  vote(2, 0, 4, 3);
  vote(3, 4, 2, 0);
  vote(4, 3, 3, 0);
  const auto groups = registry.GroupByOwner();
  ASSERT_EQ(groups.size(), 3u) << "point 4 has no owner";
  EXPECT_EQ(groups.at(kBackgroundKey)[0].id, MapPointId{1});
  EXPECT_EQ(groups.at(kOutlineKey)[0].id, MapPointId{2});
  EXPECT_EQ(groups.at(kObject)[0].id, MapPointId{3});
}

TEST_F(LandmarkStoreTest, CountsLandmarksThatAreDetectedTogetherOrCovered) {
  const LandmarkKey a = AddLandmark().key, b = AddLandmark().key, c = AddLandmark().key;
  store_.CountCoVisibility(FrameOf({a, b}), {-1, -1, 0});
  EXPECT_THAT(store_.Find(a)->evidence.observed_with, UnorderedElementsAre(Pair(b, 1)));
  EXPECT_THAT(store_.Find(b)->evidence.observed_with, UnorderedElementsAre(Pair(a, 1)));
  EXPECT_THAT(store_.Find(c)->evidence.observed_with, UnorderedElementsAre());
  EXPECT_THAT(store_.Find(c)->evidence.covered_by, UnorderedElementsAre(Pair(a, 1)));
}

TEST_F(LandmarkStoreTest, MergeAddsTheEvidenceAndRedirectsTheCounts) {
  const LandmarkKey from = AddLandmark().key, into = AddLandmark().key, other = AddLandmark().key;
  store_.Find(from)->evidence.observations = 3;
  store_.Find(from)->evidence.class_evidence = {{"cup", 2}};
  store_.Find(into)->evidence.observations = 4;
  store_.Find(into)->evidence.class_evidence = {{"cup", 1}};
  store_.CountCoVisibility(FrameOf({from, other}), {});
  store_.Merge(*store_.Find(from), *store_.Find(into), /*adopt_silhouettes=*/true);
  store_.RemoveMerged(from, into);
  const LandmarkEvidence& evidence = store_.Find(into)->evidence;
  EXPECT_EQ(evidence.observations, 7u);
  EXPECT_EQ(evidence.class_evidence.at("cup"), 3);
  EXPECT_THAT(evidence.observed_with, UnorderedElementsAre(Pair(other, 1)));
  EXPECT_THAT(store_.Find(other)->evidence.observed_with, UnorderedElementsAre(Pair(into, 1)));
  EXPECT_THAT(store_.Keys(), ElementsAre(into, other)) << "`into` is now at the position of `from`";
}

TEST_F(LandmarkStoreTest, IgnoresUpVectorsThatAreNoDirection) {
  store_.SetUp({0, 2, 0});
  EXPECT_EQ(store_.up_world(), Eigen::Vector3d::UnitY());
  store_.SetUp({0, 0, 0.1});
  store_.SetUp({0, 0, std::numeric_limits<double>::quiet_NaN()});
  EXPECT_EQ(store_.up_world(), Eigen::Vector3d::UnitY());
}

TEST_F(LandmarkStoreTest, LandmarksMoveWithTheirKeyframes) {
  Landmark& landmark = AddLandmark();
  const Sim3<World, World> S_new_old(2, Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 0, 0));
  const KeyframeId unrelated{9};
  EXPECT_FALSE(
      store_.Correct(landmark, {{unrelated, {.id = unrelated, .T_world_camera = {}, .S_new_old = S_new_old}}}));
  EXPECT_EQ(landmark.geometry.cuboid->half_extents.x(), 0.1);
  const auto motion =
      store_.Correct(landmark, {{kKeyframe, {.id = kKeyframe, .T_world_camera = {}, .S_new_old = S_new_old}}});
  ASSERT_TRUE(motion.has_value());
  EXPECT_NEAR(motion->scale(), 2, 1e-12);
  EXPECT_TRUE(landmark.geometry.cuboid->T_world_object.translation().isApprox(Eigen::Vector3d(1, 0, 0)));
  EXPECT_NEAR(landmark.geometry.cuboid->half_extents.x(), 0.2, 1e-12);
  EXPECT_TRUE(landmark.geometry.body_world[0].isApprox(Eigen::Vector3d(1.1, 0, 0)));
}

}  // namespace romap::objects::landmark_store_test
