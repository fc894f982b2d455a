#include "server/session/restored_objects.h"

#include <gmock/gmock.h>

namespace romap::session::restored_objects_test {

using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

ObjectUpdate MakeObject(uint64_t id, double x_mu, const char* class_name = "mug") {
  ObjectUpdate object;
  object.id = ObjectId{id};
  object.class_name = class_name;
  object.cuboid.T_world_object = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x_mu, 0, 0)};
  object.cuboid.half_extents = Eigen::Vector3d::Constant(0.1);
  object.map_id = SparseMapId{1};
  return object;
}

TEST(RestoredObjectsTest, FindsMovedAndRenumberedObjects) {
  const auto found = FindRestoredObjects({MakeObject(1, 0), MakeObject(4, 1)},
                                         {MakeObject(1, 1.02), MakeObject(2, -0.03), MakeObject(3, 5)});
  EXPECT_THAT(found, UnorderedElementsAre(Pair(ObjectId{1}, ObjectId{4}), Pair(ObjectId{2}, ObjectId{1})));
}

TEST(RestoredObjectsTest, PrefersTheSameClassAmongOverlappingObjects) {
  const auto found = FindRestoredObjects({MakeObject(1, 0, "saucer"), MakeObject(2, 0.05, "mug")},
                                         {MakeObject(7, 0.01, "mug"), MakeObject(8, 0.04, "saucer")});
  EXPECT_THAT(found, UnorderedElementsAre(Pair(ObjectId{7}, ObjectId{2}), Pair(ObjectId{8}, ObjectId{1})));
}

TEST(RestoredObjectsTest, ObjectsOfOtherMapsAreOthers) {
  ObjectUpdate other = MakeObject(1, 0);
  other.map_id = SparseMapId{2};
  EXPECT_THAT(FindRestoredObjects({MakeObject(1, 0)}, {other}), IsEmpty());
}

}  // namespace romap::session::restored_objects_test
