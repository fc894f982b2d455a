#include "client/sdk/map_copy.h"

#include <gtest/gtest.h>

namespace romap::client::map_copy_test {

ObjectUpdate Update(uint64_t id, uint64_t revision) {
  ObjectUpdate update;
  update.id = ObjectId{id};
  update.revision = revision;
  update.observations = revision;
  return update;
}

MeshUpdate MeshOf(uint64_t id, uint64_t revision) {
  MeshUpdate mesh;
  mesh.id = ObjectId{id};
  mesh.revision = revision;
  return mesh;
}

TEST(MapCopyTest, KeepsTheNewestCuboidAndMesh) {
  MapCopy copy;
  copy.Apply(Update(1, 3));
  copy.Apply(MeshOf(1, 2));  // older than the cuboid, but the first mesh
  copy.Apply(Update(1, 2));
  const ObjectSnapshot& object = copy.objects().at(ObjectId{1});
  EXPECT_EQ(object.object.observations, 3u);
  ASSERT_TRUE(object.mesh.has_value());
  copy.Apply(MeshOf(1, 5));
  copy.Apply(MeshOf(1, 4));
  EXPECT_EQ(object.mesh->revision, 5u);
  EXPECT_EQ(object.object.revision, 3u);
}

TEST(MapCopyTest, IgnoresAMeshOfAnUnknownObject) {
  MapCopy copy;
  copy.Apply(MeshOf(7, 1));
  EXPECT_TRUE(copy.objects().empty());
}

TEST(MapCopyTest, DropsRemovedAndMergedObjects) {
  MapCopy copy;
  for (uint64_t id : {1, 2, 3}) copy.Apply(Update(id, 1));
  copy.Apply(ObjectRemoved{ObjectId{1}, 2, "false detection"});
  copy.Apply(ObjectMerged{ObjectId{2}, ObjectId{3}, 6});
  ASSERT_EQ(copy.objects().size(), 1u);
  EXPECT_EQ(copy.objects().at(ObjectId{3}).object.revision, 6u);
}

TEST(MapCopyTest, IgnoresEventsThatDoNotConcernObjects) {
  MapCopy copy;
  copy.Apply(FrameAck{});
  copy.Apply(MasksAck{});
  copy.Apply(Statistics{});
  EXPECT_TRUE(copy.objects().empty());
}

}  // namespace romap::client::map_copy_test
