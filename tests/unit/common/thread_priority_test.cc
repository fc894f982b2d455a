#include "common/thread_priority.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <thread>

namespace romap::thread_priority_test {

int Niceness() { return getpriority(PRIO_PROCESS, static_cast<id_t>(gettid())); }

TEST(ThreadPriorityTest, LowersOnlyTheCallingThread) {
  const int before = Niceness();
  int inside = before;
  std::thread thread([&] {
    LowerThreadPriority(3);
    inside = Niceness();
  });
  thread.join();
  EXPECT_EQ(inside, before + 3);
  EXPECT_EQ(Niceness(), before);
}

}  // namespace romap::thread_priority_test
