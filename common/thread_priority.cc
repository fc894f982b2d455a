#include "common/thread_priority.h"

#include <sys/resource.h>
#include <unistd.h>

namespace romap {

void LowerThreadPriority(int nice) {
  // On Linux the nice value is per thread, and increasing it is always allowed.
  const auto thread = static_cast<id_t>(gettid());
  setpriority(PRIO_PROCESS, thread, getpriority(PRIO_PROCESS, thread) + nice);
}

}  // namespace romap
