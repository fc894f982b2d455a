#pragma once

#include <time.h>

namespace romap {

// CPU time that the calling thread has used [s]. A call of the kernel: some hundred nanoseconds.
inline double ThreadCpuSeconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace romap
