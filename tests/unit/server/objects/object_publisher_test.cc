#include "server/objects/object_publisher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <variant>

namespace romap::objects::object_publisher_test {

using ::testing::IsEmpty;
using ::testing::SizeIs;
using When = ObjectPublisher::When;

class ObjectPublisherTest : public ::testing::Test {
 protected:
  Landmark& AddLandmark(ObjectState state = ObjectState::kConfirmed) {
    Landmark& landmark = store_.Create();
    landmark.state = state;
    landmark.evidence.class_evidence["cup"] = 1;
    landmark.geometry.cuboid = Cuboid{.T_world_object = {}, .half_extents = Eigen::Vector3d::Constant(0.1)};
    landmark.geometry.training_box = landmark.geometry.cuboid;
    return landmark;
  }

  ObjectOutput Publish(const Landmark& landmark, When when = When::kChanged) {
    ObjectOutput output;
    publisher_.AssignId(landmark.key);
    publisher_.Publish(landmark, when, store_, &output);
    return output;
  }

  ObjectsConfig config_;
  LandmarkStore store_{config_};
  ObjectPublisher publisher_{config_};
};

TEST_F(ObjectPublisherTest, PublishesAConfirmedObjectToClientsAndItsField) {
  const Landmark& landmark = AddLandmark();
  const ObjectOutput output = Publish(landmark);
  ASSERT_THAT(output.events, SizeIs(1));
  const auto& update = std::get<ObjectUpdate>(output.events[0]);
  EXPECT_EQ(update.id, publisher_.AssignId(landmark.key));
  EXPECT_EQ(update.class_name, "cup");
  ASSERT_THAT(output.views, SizeIs(1));
  EXPECT_EQ(output.views[0].object, update.id);
}

TEST_F(ObjectPublisherTest, AProvisionalObjectHasNoField) {
  const ObjectOutput output = Publish(AddLandmark(ObjectState::kProvisional));
  EXPECT_THAT(output.events, SizeIs(1));
  EXPECT_THAT(output.views, IsEmpty());
}

TEST_F(ObjectPublisherTest, DoesNotPublishSmallChanges) {
  Landmark& landmark = AddLandmark();
  Publish(landmark);
  landmark.geometry.cuboid->half_extents.x() += 0.001;
  EXPECT_THAT(Publish(landmark).events, IsEmpty());
  EXPECT_THAT(Publish(landmark, When::kAlways).events, SizeIs(1));
  landmark.geometry.cuboid->half_extents.x() += 0.01;
  EXPECT_THAT(Publish(landmark).events, SizeIs(1));
  landmark.state = ObjectState::kLost;
  EXPECT_THAT(Publish(landmark).events, SizeIs(1));
}

TEST_F(ObjectPublisherTest, SmallCorrectionsAddUp) {
  Landmark& landmark = AddLandmark();
  Publish(landmark);
  const Sim3<World, World> S(1, Eigen::Quaterniond::Identity(), {0.0006, 0, 0});
  for (int i = 0; i < 2; ++i) {
    publisher_.Correct(landmark.key, S, {});
    landmark.geometry.cuboid->T_world_object = S.Moved(landmark.geometry.cuboid->T_world_object);
    EXPECT_TRUE(publisher_.HasUnpublishedCorrection(landmark.key));
    const ObjectOutput output = Publish(landmark);
    if (i == 0) {
      EXPECT_THAT(output.events, IsEmpty());
      continue;
    }
    EXPECT_THAT(output.events, SizeIs(1));
    ASSERT_THAT(output.views, SizeIs(1));
    ASSERT_TRUE(output.views[0].S_new_old.has_value());
    EXPECT_NEAR(output.views[0].S_new_old->translation().x(), 0.0012, 1e-12);
  }
  EXPECT_FALSE(publisher_.HasUnpublishedCorrection(landmark.key));
}

TEST_F(ObjectPublisherTest, ReportsTheRemovalOfPublishedObjectsOnly) {
  const Landmark& published = AddLandmark();
  const Landmark& unpublished = AddLandmark();
  Publish(published);
  ObjectOutput output;
  publisher_.Remove(unpublished.key, "not observed again", &output);
  EXPECT_THAT(output.events, IsEmpty());
  publisher_.Remove(published.key, "not observed again", &output);
  ASSERT_THAT(output.events, SizeIs(1));
  EXPECT_EQ(std::get<ObjectRemoved>(output.events[0]).reason, "not observed again");
  EXPECT_FALSE(publisher_.IsPublished(published.key));
}

TEST_F(ObjectPublisherTest, PublishesTheRemainingObjectBeforeAMerge) {
  const Landmark& from = AddLandmark();
  const Landmark& into = AddLandmark();
  Publish(from);
  const ObjectId id = publisher_.AssignId(into.key);
  ObjectOutput output;
  publisher_.Merge(from, into, /*adopt_views=*/true, store_, &output);
  ASSERT_THAT(output.events, SizeIs(3));
  EXPECT_EQ(std::get<ObjectUpdate>(output.events[0]).id, id);
  EXPECT_EQ(std::get<ObjectMerged>(output.events[1]).into, id);
  EXPECT_EQ(std::get<ObjectUpdate>(output.events[2]).id, id);
  EXPECT_FALSE(publisher_.HasId(from.key));
}

TEST_F(ObjectPublisherTest, MergesIntoConfirmedThenOlderObjects) {
  const Landmark& older = AddLandmark();
  const Landmark& newer = AddLandmark();
  const Landmark& provisional = AddLandmark(ObjectState::kProvisional);
  for (const Landmark* landmark : {&provisional, &older, &newer}) publisher_.AssignId(landmark->key);
  EXPECT_LT(publisher_.MergeRank(older), publisher_.MergeRank(newer));
  EXPECT_LT(publisher_.MergeRank(newer), publisher_.MergeRank(provisional));
}

TEST_F(ObjectPublisherTest, NeverReusesIds) {
  const Landmark& first = AddLandmark();
  const ObjectId id = publisher_.AssignId(first.key);
  ObjectOutput output;
  publisher_.Remove(first.key, "map was reset", &output);
  EXPECT_LT(id, publisher_.AssignId(AddLandmark().key));
}

}  // namespace romap::objects::object_publisher_test
