#include "common/bounded_queue.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

namespace romap::bounded_queue_test {

TEST(BoundedQueueTest, KeepsOrderAndDrainsAfterClose) {
  BoundedQueue<int> queue(4);
  EXPECT_TRUE(queue.Push(1));
  EXPECT_TRUE(queue.Push(2));
  queue.Close();
  EXPECT_FALSE(queue.Push(3));
  EXPECT_FALSE(queue.Drained());
  EXPECT_EQ(queue.Pop(), 1);
  EXPECT_EQ(queue.Pop(), 2);
  EXPECT_EQ(queue.Pop(), std::nullopt);
  EXPECT_TRUE(queue.Drained());
}

TEST(BoundedQueueTest, PushWaitsWhileTheQueueIsFull) {
  BoundedQueue<int> queue(1);
  ASSERT_TRUE(queue.Push(1));
  std::atomic<bool> pushed = false;
  std::thread producer([&] {
    queue.Push(2);
    pushed = true;
  });
  EXPECT_EQ(queue.PopFor(std::chrono::seconds(5)), 1);
  EXPECT_EQ(queue.PopFor(std::chrono::seconds(5)), 2);
  producer.join();
  EXPECT_TRUE(pushed);
}

TEST(BoundedQueueTest, CloseEndsABlockedPush) {
  BoundedQueue<int> queue(1);
  ASSERT_TRUE(queue.Push(1));
  bool taken = true;
  std::thread producer([&] { taken = queue.Push(2); });
  queue.Close();
  producer.join();
  EXPECT_FALSE(taken);
  EXPECT_EQ(queue.Pop(), 1);
}

TEST(BoundedQueueTest, ForcePushExceedsTheCapacity) {
  BoundedQueue<int> queue(1);
  EXPECT_TRUE(queue.Push(1));
  EXPECT_TRUE(queue.ForcePush(2));
  EXPECT_EQ(queue.Size(), 2U);
  EXPECT_EQ(queue.Pop(), 1);
  EXPECT_EQ(queue.Pop(), 2);
  queue.Close();
  EXPECT_FALSE(queue.ForcePush(3));
}

TEST(BoundedQueueTest, PushDroppingOldestKeepsTheNewest) {
  BoundedQueue<int> queue(2);
  bool accepted = false;
  EXPECT_EQ(queue.PushDroppingOldest(1, &accepted), std::nullopt);
  EXPECT_EQ(queue.PushDroppingOldest(2, &accepted), std::nullopt);
  EXPECT_EQ(queue.PushDroppingOldest(3, &accepted), 1);
  EXPECT_TRUE(accepted);
  EXPECT_EQ(queue.Pop(), 2);
  EXPECT_EQ(queue.Pop(), 3);
  queue.Close();
  queue.PushDroppingOldest(4, &accepted);
  EXPECT_FALSE(accepted);
}

}  // namespace romap::bounded_queue_test
