#pragma once

#include <time.h>

namespace romap {

// CPU time used by the calling thread [s]. Makes a system call, which takes a few hundred nanoseconds.
inline double ThreadCpuSeconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace romap
