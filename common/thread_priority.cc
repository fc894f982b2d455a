#include "common/thread_priority.h"

#include <sys/resource.h>
#include <unistd.h>

namespace romap {

void LowerThreadPriority() {
  constexpr int kNicer = 10;
  // On Linux the nice value belongs to the thread, and lowering one's priority is always allowed.
  const auto thread = static_cast<id_t>(gettid());
  setpriority(PRIO_PROCESS, thread, getpriority(PRIO_PROCESS, thread) + kNicer);
}

}  // namespace romap
