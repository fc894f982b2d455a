// Measures the store: the time from the acceptance of an input to the message that it is durable, and the throughput.
//
//   store_bench DATA_DIR
//
// Writes 500 frames of 110 kB at 25 Hz, then 1000 as fast as the store accepts them.

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

#include "common/status.h"
#include "server/store/store.h"
#include "tests/support/streams.h"

namespace romap::measure {
namespace {

using Clock = std::chrono::steady_clock;
constexpr size_t kFrameBytes = 110'000;

class Writer {
 public:
  explicit Writer(store::Store& store) : store_(store) {
    store_.SetListener("bench", {.durable = [this](const Durable& durable) { Note(durable.frame_id); },
                                 .trouble = [](const absl::Status&) {}});
  }
  ~Writer() { store_.RemoveListener("bench"); }

  // Returns the delays until the frames are durable [ms], ascending.
  std::vector<double> Write(int frames, std::chrono::milliseconds period) {
    FrameInput frame = testing_support::MakeFrame(1);
    frame.image.assign(kFrameBytes, 'x');
    const Clock::time_point start = Clock::now();
    for (int i = 0; i < frames; ++i) {
      std::this_thread::sleep_until(start + i * period);
      frame.frame_id = ++newest_;
      {
        std::lock_guard lock(mutex_);
        waiting_[newest_] = Clock::now();
      }
      store_.AppendInput("bench", frame, /*may_wait=*/true);
    }
    std::unique_lock lock(mutex_);
    durable_.wait(lock, [&] { return waiting_.empty(); });
    std::sort(delays_ms_.begin(), delays_ms_.end());
    return std::exchange(delays_ms_, {});
  }

 private:
  void Note(uint64_t frame_id) {
    std::lock_guard lock(mutex_);
    while (!waiting_.empty() && waiting_.begin()->first <= frame_id) {
      delays_ms_.push_back(std::chrono::duration<double, std::milli>(Clock::now() - waiting_.begin()->second).count());
      waiting_.erase(waiting_.begin());
    }
    durable_.notify_all();
  }

  store::Store& store_;
  uint64_t newest_ = 0;
  std::mutex mutex_;
  std::condition_variable durable_;
  std::map<uint64_t, Clock::time_point> waiting_;
  std::vector<double> delays_ms_;
};

absl::Status Measure(const std::string& dir) {
  store::StoreConfig config;
  config.data_dir = dir;
  ROMAP_ASSIGN_OR_RETURN(const auto store, store::Store::Open(config));
  store::StoredSession session;
  session.id = "bench";
  session.options.camera = testing_support::SmallCamera();
  ROMAP_RETURN_IF_ERROR(store->Create(session));
  {
    Writer writer(*store);
    const std::vector<double> live = writer.Write(500, std::chrono::milliseconds(40));
    fmt::print("25 frames/s of {} kB, time until durable [ms]: p50 {:.1f}, p99 {:.1f}, longest {:.1f}\n",
               kFrameBytes / 1000, live[live.size() / 2], live[live.size() * 99 / 100], live.back());
    const Clock::time_point start = Clock::now();
    writer.Write(1000, std::chrono::milliseconds(0));
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    fmt::print("as fast as possible: {:.0f} frames/s, {:.0f} MB/s\n", 1000 / seconds,
               1000 * kFrameBytes / 1e6 / seconds);
  }
  fmt::print("bytes on disk per byte of input: {:.3f}\n",
             static_cast<double>(store->BytesOf("bench")) / (1500.0 * kFrameBytes));
  return store->Remove("bench");
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: store_bench DATA_DIR\n");
    return 2;
  }
  const absl::Status status = romap::measure::Measure(argv[1]);
  if (!status.ok()) fmt::print(stderr, "store_bench: {}\n", romap::Message(status));
  return status.ok() ? 0 : 1;
}
