// Memory of an object during training.
#include <gtest/gtest.h>
#include <malloc.h>

#include "server/nerf/object_field.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::object_memory_test {

size_t HeapBytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

TEST(ObjectMemoryTest, FortyViewsStayWithinTheLimit) {
  if (HeapBytes() == 0) GTEST_SKIP() << "the allocator does not report its size";
  testing_support::BallScene scene;
  scene.views = 40;
  scene.size_px = 240;  // the crop of a large object in a VGA image
  const size_t before = HeapBytes();
  ObjectField field(NerfConfig{}, scene.object, 1);
  ASSERT_TRUE(field.SetBox(scene.Box()).ok());
  for (int i = 0; i < scene.views; ++i) ASSERT_TRUE(field.AddView(scene.View(i)).ok());
  ASSERT_EQ(field.Train(2, 2).steps, 2);
  EXPECT_LE(HeapBytes() - before, 24u << 20);
  field.ReleaseScratch();
  EXPECT_LE(HeapBytes() - before, 21u << 20);
}

}  // namespace romap::nerf::object_memory_test
