#include "server/objects/landmark_decisions.h"

#include <gtest/gtest.h>

#include <string>

namespace romap::objects::landmark_decisions_test {

Cuboid CubeAt(double x_mu, double half_extent_mu = 0.1) {
  return {.T_world_object = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x_mu, 0, 0)},
          .half_extents = Eigen::Vector3d::Constant(half_extent_mu)};
}

// A landmark that passes every test of DecideConfirmation().
Landmark GoodLandmark(LandmarkKey key, double x_mu = 0) {
  const ObjectsConfig config;
  Landmark landmark(key, config);
  landmark.evidence.observations = static_cast<uint64_t>(config.confirm_frames);
  landmark.evidence.expected = landmark.evidence.observations;
  landmark.evidence.keyframe_observations = config.confirm_keyframes;
  landmark.evidence.whole_observations = 1;
  landmark.evidence.class_evidence["cup"] = 5;
  landmark.geometry.cuboid = CubeAt(x_mu);
  landmark.geometry.training_box = landmark.geometry.cuboid;
  landmark.geometry.parallax_rad = 0.6;
  for (int i = 0; i < 20; ++i) landmark.geometry.body_world.emplace_back(x_mu + 0.09 * (i % 3 - 1), 0.004 * i, 0.01);
  return landmark;
}

std::string ReasonNotToConfirm(const Landmark& landmark, const ObjectsConfig& config = {}) {
  const Decision decision = DecideConfirmation(landmark.evidence, landmark.geometry, config);
  return decision.yes ? "" : decision.reason;
}

TEST(DecideConfirmation, AcceptsEnoughConsistentObservations) { EXPECT_EQ(ReasonNotToConfirm(GoodLandmark(1)), ""); }

TEST(DecideConfirmation, NeedsAPlausibleCuboid) {
  Landmark landmark = GoodLandmark(1);
  landmark.geometry.cuboid->half_extents = {1, 1, 0.01};
  EXPECT_EQ(ReasonNotToConfirm(landmark), "implausible cuboid proportions");
  landmark.geometry.cuboid->half_extents.z() = 0;
  EXPECT_EQ(ReasonNotToConfirm(landmark), "implausible cuboid proportions");
  landmark.geometry.cuboid.reset();
  EXPECT_EQ(ReasonNotToConfirm(landmark), "no cuboid yet");
}

TEST(DecideConfirmation, NeedsDetectionsInEnoughOfTheFramesThatShouldShowIt) {
  ObjectsConfig config;
  config.confirm_seen_share = 0.5;
  Landmark landmark = GoodLandmark(1);
  landmark.evidence.expected = 2 * landmark.evidence.observations;
  EXPECT_EQ(ReasonNotToConfirm(landmark, config), "");
  ++landmark.evidence.expected;
  EXPECT_EQ(ReasonNotToConfirm(landmark, config), "detected in too few of the frames that should show it");
}

TEST(DecideConfirmation, NeedsMasksThatAgreeOnceThereAreThree) {
  Landmark landmark = GoodLandmark(1);
  landmark.evidence.agreement_sum = 0.8;
  landmark.evidence.agreement_count = 2;
  EXPECT_EQ(ReasonNotToConfirm(landmark), "");
  landmark.evidence.agreement_count = 3;
  EXPECT_EQ(ReasonNotToConfirm(landmark), "masks disagree with its shape");
}

TEST(DecideConfirmation, RejectsALandmarkThatAnotherMaskCoversInMostFrames) {
  Landmark landmark = GoodLandmark(1);
  landmark.evidence.covered_by[7] = landmark.evidence.observations;
  EXPECT_EQ(ReasonNotToConfirm(landmark), "");
  ++landmark.evidence.covered_by[7];
  EXPECT_EQ(ReasonNotToConfirm(landmark), "covered by the mask of another object too often");
}

TEST(DecideConfirmation, NeedsFramesAndKeyframes) {
  Landmark landmark = GoodLandmark(1);
  --landmark.evidence.observations;
  EXPECT_EQ(ReasonNotToConfirm(landmark), "too few observations");
  ++landmark.evidence.observations;
  --landmark.evidence.keyframe_observations;
  EXPECT_EQ(ReasonNotToConfirm(landmark), "too few keyframes");
}

TEST(DecideConfirmation, NeedsAViewThatShowsTheWholeObject) {
  Landmark landmark = GoodLandmark(1);
  landmark.evidence.whole_observations = 0;
  EXPECT_EQ(ReasonNotToConfirm(landmark), "always cut off by the border of the image");
}

TEST(DecideConfirmation, NeedsMoreParallaxWithoutMapPoints) {
  ObjectsConfig config;
  config.confirm_parallax_deg = 30;  // 0.52 rad, and 0.79 rad without points
  Landmark landmark = GoodLandmark(1);
  EXPECT_EQ(ReasonNotToConfirm(landmark, config), "too little parallax");
  landmark.geometry.points.resize(static_cast<size_t>(config.min_object_points));
  EXPECT_EQ(ReasonNotToConfirm(landmark, config), "");
}

TEST(DecideAnnouncement, NeedsACuboidAndThreeObservations) {
  Landmark landmark = GoodLandmark(1);
  landmark.evidence.observations = 2;
  EXPECT_FALSE(DecideAnnouncement(landmark.evidence, landmark.geometry).yes);
  landmark.evidence.observations = 3;
  EXPECT_TRUE(DecideAnnouncement(landmark.evidence, landmark.geometry).yes);
  landmark.geometry.cuboid.reset();
  EXPECT_FALSE(DecideAnnouncement(landmark.evidence, landmark.geometry).yes);
}

TEST(DecideLoss, LosesOnlyConfirmedObjectsAfterEnoughMissedFrames) {
  ObjectsConfig config;
  config.lost_after_frames = 5;
  LandmarkEvidence evidence;
  evidence.missed_in_view = 4;
  EXPECT_FALSE(DecideLoss(ObjectState::kConfirmed, evidence, config).yes);
  evidence.missed_in_view = 5;
  EXPECT_TRUE(DecideLoss(ObjectState::kConfirmed, evidence, config).yes);
  EXPECT_FALSE(DecideLoss(ObjectState::kProvisional, evidence, config).yes);
  EXPECT_FALSE(DecideLoss(ObjectState::kLost, evidence, config).yes);
}

std::string ReasonToPrune(ObjectState state, const LandmarkEvidence& evidence, bool has_cuboid, uint64_t frame_index) {
  const Decision decision = DecidePruning(state, evidence, has_cuboid, frame_index, {});
  return decision.yes ? decision.reason : "";
}

TEST(DecidePruning, NeverRemovesConfirmedObjects) {
  LandmarkEvidence evidence;
  evidence.expected = 1000;
  evidence.missed_in_view = 1000;
  evidence.covered_by[2] = 1000;
  EXPECT_EQ(ReasonToPrune(ObjectState::kConfirmed, evidence, true, 5000), "");
}

TEST(DecidePruning, RemovesLostObjectsThatWereDetectedTooRarely) {
  LandmarkEvidence evidence;
  evidence.observations = 20;
  evidence.expected = 100;
  EXPECT_EQ(ReasonToPrune(ObjectState::kLost, evidence, true, 5000), "");
  ++evidence.expected;
  EXPECT_EQ(ReasonToPrune(ObjectState::kLost, evidence, true, 5000),
            "detected in too few of the frames that should show it");
}

TEST(DecidePruning, RemovesPartsOfOtherObjects) {
  LandmarkEvidence evidence;
  evidence.observations = 4;
  evidence.covered_by[2] = 12;
  EXPECT_EQ(ReasonToPrune(ObjectState::kProvisional, evidence, true, 0), "");
  ++evidence.covered_by[2];
  EXPECT_EQ(ReasonToPrune(ObjectState::kProvisional, evidence, true, 0), "part of another object");
}

TEST(DecidePruning, RemovesMissedAndUnobservedLandmarks) {
  LandmarkEvidence evidence;
  evidence.last_frame = 100;
  evidence.missed_in_view = 39;
  EXPECT_EQ(ReasonToPrune(ObjectState::kProvisional, evidence, false, 140), "");
  EXPECT_EQ(ReasonToPrune(ObjectState::kProvisional, evidence, false, 141), "not observed again");
  EXPECT_EQ(ReasonToPrune(ObjectState::kProvisional, evidence, true, 500), "") << "longer with a cuboid";
  EXPECT_EQ(ReasonToPrune(ObjectState::kProvisional, evidence, true, 501), "not observed again");
  evidence.missed_in_view = 40;
  EXPECT_EQ(ReasonToPrune(ObjectState::kProvisional, evidence, true, 101), "no longer detected where it was observed");
}

TEST(DecidePruningAtFinish, RemovesProvisionalLandmarks) {
  EXPECT_TRUE(DecidePruningAtFinish(ObjectState::kProvisional).yes);
  EXPECT_FALSE(DecidePruningAtFinish(ObjectState::kConfirmed).yes);
  EXPECT_FALSE(DecidePruningAtFinish(ObjectState::kLost).yes);
}

TEST(CountCoVisibility, CountsBothDirectionsOfCovering) {
  Landmark a = GoodLandmark(1);
  Landmark b = GoodLandmark(2);
  a.evidence.observed_with[2] = b.evidence.observed_with[1] = 4;
  a.evidence.covered_by[2] = 3;
  b.evidence.covered_by[1] = 5;
  b.evidence.covered_by[9] = 7;
  EXPECT_EQ(CountCoVisibility(a, b).together, 4u);
  EXPECT_EQ(CountCoVisibility(a, b).covered, 8u);
}

TEST(DecideMerge, MergesTheSameVolume) {
  const Landmark a = GoodLandmark(1);
  Landmark b = GoodLandmark(2);
  EXPECT_TRUE(DecideMerge(a, b, {}).yes);
  b.evidence.class_evidence = {{"book", 5}};
  EXPECT_TRUE(DecideMerge(a, b, {}).yes) << "the class does not matter for the same volume";
}

TEST(DecideMerge, KeepsObjectsThatWereDetectedSideBySide) {
  Landmark a = GoodLandmark(1);
  Landmark b = GoodLandmark(2);
  a.evidence.observed_with[2] = b.evidence.observed_with[1] = 2;
  EXPECT_STREQ(DecideMerge(a, b, {}).reason, "detected side by side");
  // One mask covered both much more often: the detector splits one object at times.
  a.evidence.covered_by[2] = 5;
  EXPECT_TRUE(DecideMerge(a, b, {}).yes);
}

TEST(DecideMerge, KeepsDistantObjects) {
  EXPECT_STREQ(DecideMerge(GoodLandmark(1), GoodLandmark(2, 1.0), {}).reason, "too far apart");
}

TEST(DecideMerge, PartialOverlapNeedsTheSameClass) {
  const Landmark a = GoodLandmark(1);
  Landmark b = GoodLandmark(2, 0.12);  // a third of its body is inside the other cuboid
  EXPECT_TRUE(DecideMerge(a, b, {}).yes);
  b.evidence.class_evidence = {{"book", 5}};
  EXPECT_STREQ(DecideMerge(a, b, {}).reason, "of different classes");
}

TEST(DecideMerge, ComparesALandmarkWithoutCuboidByItsPoints) {
  const Landmark a = GoodLandmark(1);
  Landmark b = GoodLandmark(2);
  b.geometry.cuboid.reset();
  EXPECT_STREQ(DecideMerge(a, b, {}).reason, "the map points do not agree") << "the first landmark has no map points";
  for (Eigen::Vector3d& p : b.geometry.body_world) p.x() += 5;
  EXPECT_STREQ(DecideMerge(a, b, {}).reason, "the points lie outside the other cuboid");
  EXPECT_STREQ(DecideMerge(b, b, {}).reason, "neither has a cuboid");
}

}  // namespace romap::objects::landmark_decisions_test
