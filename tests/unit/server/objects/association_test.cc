#include "server/objects/association.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "server/objects/projection.h"

namespace romap::objects::association_test {

using ::testing::NotNull;

// A camera at the origin of the world that looks along z, and cubes with sides of 0.2 map units, 2 map units away, each
// with its landmark.
class AssociationTest : public ::testing::Test {
 protected:
  AssociationTest() {
    frame_->frame_id = 1;
    frame_->camera = {.width_px = 320, .height_px = 240, .fx_px = 300, .fy_px = 300, .cx_px = 160, .cy_px = 120};
    frame_->has_masks = true;
    frame_->labels = cv::Mat::zeros(240, 320, CV_16UC1);
    tracked_.frame = frame_;
  }

  Landmark& AddCube(double x_mu, const std::string& class_name, double z_mu = 2) {
    auto landmark = std::make_unique<Landmark>(static_cast<LandmarkKey>(landmarks_.size() + 1), config_);
    landmark->state = ObjectState::kConfirmed;
    landmark->geometry.cuboid =
        Cuboid{.T_world_object = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x_mu, 0, z_mu)},
               .half_extents = Eigen::Vector3d::Constant(0.1)};
    for (double share : {-0.8, -0.3, 0.3, 0.8}) {
      for (double other : {-0.8, 0.0, 0.8}) {
        landmark->geometry.body_world.push_back(landmark->geometry.cuboid->T_world_object *
                                                Eigen::Vector3d(0.1 * share, 0.1 * other, 0));
      }
    }
    landmark->evidence.class_evidence[class_name] = 10;
    landmark->evidence.observations = 10;
    landmark->evidence.last_frame = 9;
    landmark->last_box_px = BoxOf(*landmark);
    landmarks_.push_back(std::move(landmark));
    return *landmarks_.back();
  }

  cv::Rect BoxOf(const Landmark& landmark) const {
    return ProjectCuboid(*landmark.geometry.cuboid, 1, frame_->camera, tracked_.T_world_camera);
  }

  void AddMask(uint16_t label, const cv::Rect& box, const std::string& class_name) {
    cv::rectangle(frame_->labels, box, cv::Scalar(label), cv::FILLED);
    frame_->instances.push_back({.label = label, .class_name = class_name, .track_id = {}});
  }

  Association Run() {
    return Associate(tracked_, ExtractDetections(*frame_, config_), landmarks_, /*frame_index=*/10, 2, config_);
  }

  ObjectsConfig config_;
  std::shared_ptr<Frame> frame_ = std::make_shared<Frame>();
  TrackedFrame tracked_;
  std::vector<std::unique_ptr<Landmark>> landmarks_;
};

TEST_F(AssociationTest, IdenticalNeighborsKeepTheirMasks) {
  AddCube(-0.15, "cup");
  AddCube(0.15, "cup");
  AddMask(3, BoxOf(*landmarks_[1]), "cup");
  AddMask(8, BoxOf(*landmarks_[0]), "cup");
  const Association association = Run();
  ASSERT_EQ(association.matches.size(), 2u);
  EXPECT_EQ(association.matches[0].landmark, 1);
  EXPECT_EQ(association.matches[1].landmark, 0);
  EXPECT_EQ(association.matches[0].doubt, nullptr);
}

TEST_F(AssociationTest, OnlyLandmarksObservedTogetherAreRivals) {
  AddCube(0, "cup");
  AddCube(0.005, "cup");
  AddMask(1, BoxOf(*landmarks_[0]), "cup");
  EXPECT_EQ(Run().matches[0].doubt, nullptr) << "they may be one object";
  landmarks_[0]->evidence.observed_with[landmarks_[1]->key] = 3;
  landmarks_[1]->evidence.observed_with[landmarks_[0]->key] = 3;
  EXPECT_THAT(Run().matches[0].doubt, NotNull());
}

TEST_F(AssociationTest, GeometryOutweighsAWrongClass) {
  AddCube(-0.15, "cup");
  AddCube(0.15, "book");
  AddMask(1, BoxOf(*landmarks_[0]), "book");
  AddMask(2, BoxOf(*landmarks_[1]), "cup");
  const Association association = Run();
  EXPECT_EQ(association.matches[0].landmark, 0);
  EXPECT_EQ(association.matches[1].landmark, 1);
}

TEST_F(AssociationTest, ClassDecidesBetweenEqualGeometry) {
  AddCube(0, "cup");
  AddCube(0, "book");
  AddMask(1, BoxOf(*landmarks_[0]), "book");
  EXPECT_EQ(Run().matches[0].landmark, 1);
}

TEST_F(AssociationTest, AMaskOverTwoNeighborsIsMarkedAsDoubtful) {
  AddCube(-0.13, "cup");
  AddCube(0.13, "cup");
  AddMask(1, BoxOf(*landmarks_[0]) | BoxOf(*landmarks_[1]), "cup");
  const Association association = Run();
  EXPECT_GE(association.matches[0].landmark, 0);
  EXPECT_THAT(association.matches[0].doubt, NotNull());
  for (int cover : association.covered_by) EXPECT_EQ(cover, -1) << "a mask over two objects covers neither";
  for (double visible : association.visible_share) EXPECT_LT(visible, 0.3) << "neither is missed";
}

TEST_F(AssociationTest, PartsOfAnObjectAreNotNewObjects) {
  AddCube(0, "box");
  const cv::Rect box = BoxOf(*landmarks_[0]);
  const int third = box.width / 3;
  AddMask(1, {box.x, box.y, box.width - third, box.height}, "box");
  AddMask(2, {box.br().x - third, box.y, third, box.height}, "box");
  const Association association = Run();
  EXPECT_EQ(association.matches[0].landmark, 0);
  EXPECT_THAT(association.matches[0].doubt, NotNull()) << "its mask is too small";
  EXPECT_EQ(association.matches[1].landmark, -1);
  EXPECT_THAT(association.matches[1].doubt, NotNull()) << "must not create a landmark";
}

TEST_F(AssociationTest, AnObjectInFrontOfAnotherIsNotItsPart) {
  AddCube(0, "box");
  const cv::Rect box = BoxOf(*landmarks_[0]);
  AddMask(1, box, "box");
  AddMask(2, {box.x + 8, box.y + 8, 12, 12}, "cup");  // the box is visible all around it
  const Association association = Run();
  EXPECT_EQ(association.matches[0].landmark, 0);
  EXPECT_EQ(association.matches[0].doubt, nullptr);
  EXPECT_EQ(association.matches[1].landmark, -1);
  EXPECT_EQ(association.matches[1].doubt, nullptr) << "a new object";
}

TEST_F(AssociationTest, AgreementFallsWhenTheMaskIsIncomplete) {
  AddCube(0, "box");
  const cv::Rect box = BoxOf(*landmarks_[0]);
  AddMask(1, box, "box");
  const auto good = Run().matches[0].agreement;
  frame_->labels.setTo(0);
  cv::rectangle(frame_->labels, {box.x, box.y, box.width, box.height / 2}, cv::Scalar(1), cv::FILLED);
  const auto half = Run().matches[0].agreement;
  ASSERT_TRUE(good && half);
  EXPECT_GT(*good, 0.9);
  EXPECT_LT(*half, 0.65);
}

TEST_F(AssociationTest, AnOccludedObjectCausesNoDoubtAboutTheMaskInFront) {
  AddCube(0, "box");
  AddCube(0, "cup", 3);  // behind it, and smaller in the image
  AddMask(1, BoxOf(*landmarks_[0]), "box");
  const Association association = Run();
  EXPECT_EQ(association.matches[0].landmark, 0);
  EXPECT_EQ(association.matches[0].doubt, nullptr);
  EXPECT_EQ(association.covered_by[1], 0);
  EXPECT_LT(association.visible_share[1], 0.1);
}

TEST_F(AssociationTest, AnObjectThatReappearsFromBehindAnotherMatchesByItsVisiblePart) {
  AddCube(0, "cup").evidence.last_frame = 0;  // occluded for a long time
  const cv::Rect box = BoxOf(*landmarks_[0]);
  AddCube(0.05, "box", 1.7);
  landmarks_[1]->last_box_px = BoxOf(*landmarks_[1]);
  const int visible_px = box.width / 4;
  AddMask(1, {box.x, box.y, visible_px, box.height}, "cup");
  AddMask(2, {box.x + visible_px, box.y - 4, box.width + 6, box.height + 8}, "box");
  const Association association = Associate(tracked_, ExtractDetections(*frame_, config_), landmarks_,
                                            /*frame_index=*/60, 2, config_);
  EXPECT_EQ(association.matches[0].landmark, 0);
  EXPECT_EQ(association.matches[1].landmark, 1);
}

TEST_F(AssociationTest, AnUnoccludedObjectWithoutMaskIsFullyVisible) {
  AddCube(-0.15, "cup");
  AddCube(0.15, "cup");
  AddMask(1, BoxOf(*landmarks_[0]), "cup");
  const Association association = Run();
  EXPECT_EQ(association.matches[0].landmark, 0);
  EXPECT_DOUBLE_EQ(association.visible_share[1], 1);
  EXPECT_EQ(association.covered_by[1], -1);
}

TEST_F(AssociationTest, ADistantMaskMatchesNoLandmark) {
  AddCube(0, "cup");
  AddMask(1, {5, 5, 40, 40}, "cup");
  EXPECT_EQ(Run().matches[0].landmark, -1);
}

TEST_F(AssociationTest, GreedyIouMatchesOnlyThePreviousFrame) {
  config_.association = "greedy_iou";
  AddCube(-0.15, "cup");
  AddCube(0.15, "cup").evidence.last_frame = 7;
  AddMask(1, BoxOf(*landmarks_[0]), "cup");
  AddMask(2, BoxOf(*landmarks_[1]), "cup");
  const Association association = Run();
  EXPECT_EQ(association.matches[0].landmark, 0);
  EXPECT_EQ(association.matches[1].landmark, -1);
}

TEST_F(AssociationTest, WithoutMasksEveryLandmarkIsVisibleAndUnmatched) {
  AddCube(0, "cup");
  const Association association = Run();
  EXPECT_TRUE(association.matches.empty());
  EXPECT_DOUBLE_EQ(association.visible_share[0], 1);
}

}  // namespace romap::objects::association_test
