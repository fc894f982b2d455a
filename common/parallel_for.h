#pragma once

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <cstddef>

namespace romap {

// Parallel loops on oneTBB's threads. A target that includes this header links TBB::tbb.
//
// The distribution's oneTBB is built without ThreadSanitizer, which then sees neither the start nor the end of a loop.
// The two atomic variables order the caller's writes before the bodies, and the bodies' writes before the return, in a
// way that it does see; their time is negligible beside that of a task.

// Calls body(begin, end) for disjoint ranges that together are [0, count), of about `grain` elements or more.
template <class Body>
void ParallelForRanges(size_t count, size_t grain, const Body& body) {
  using Range = oneapi::tbb::blocked_range<size_t>;
  std::atomic<size_t> started{0};
  std::atomic<size_t> finished{0};
  started.store(1, std::memory_order_release);
  oneapi::tbb::parallel_for(Range(0, count, grain), [&](const Range& range) {
    started.load(std::memory_order_acquire);
    body(range.begin(), range.end());
    finished.fetch_add(range.size(), std::memory_order_release);
  });
  finished.load(std::memory_order_acquire);
}

// Calls body(i) for all i in [0, count).
template <class Index, class Body>
void ParallelFor(Index count, const Body& body) {
  ParallelForRanges(static_cast<size_t>(count), 1, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) body(static_cast<Index>(i));
  });
}

}  // namespace romap
