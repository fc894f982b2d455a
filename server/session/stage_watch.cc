#include "server/session/stage_watch.h"

#include <execinfo.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <thread>

namespace romap::session {
namespace {

constexpr int kMaxFrames = 48;

// Written by the signal handler on the thread whose stack is wanted, one at a time.
void* g_frames[kMaxFrames];
std::atomic<int> g_frame_count = -1;

void SaveStack(int /*signal*/) { g_frame_count = backtrace(g_frames, kMaxFrames); }

// The stack of another thread of this process, which must exist.
std::string StackOf(pthread_t thread) {
  static std::mutex one_at_a_time;
  std::lock_guard lock(one_at_a_time);
  const int signal = SIGRTMIN + 5;
  struct sigaction action = {};
  action.sa_handler = SaveStack;
  action.sa_flags = SA_RESTART;
  void* first[1];
  backtrace(first, 1);  // loads what the handler must not load
  g_frame_count = -1;
  if (sigaction(signal, &action, nullptr) != 0 || pthread_kill(thread, signal) != 0) return "unknown";
  for (int i = 0; i < 100 && g_frame_count < 0; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const int count = g_frame_count;
  if (count <= 0) return "unknown: the thread takes no signals";
  const std::unique_ptr<char*, decltype(&std::free)> names(backtrace_symbols(g_frames, count), &std::free);
  std::string stack;
  for (int i = 2; names && i < count; ++i) {  // without the handler and what called it
    if (!stack.empty()) stack += " < ";
    stack += names.get()[i];
  }
  return stack;
}

}  // namespace

StageWatch::Scope::Scope(StageWatch* watch, const char* stage) : watch_(watch) {
  std::lock_guard lock(watch_->mutex_);
  entry_ = watch_->running_.insert(watch_->running_.end(),
                                   {.stage = stage, .thread = pthread_self(), .since = Clock::now()});
}

StageWatch::Scope::~Scope() {
  std::lock_guard lock(watch_->mutex_);
  watch_->running_.erase(entry_);
}

// Under the lock, so that the stage cannot end, and its thread with it.
std::optional<StageHang> StageWatch::FindHang(std::chrono::duration<double> limit,
                                              std::chrono::duration<double> confirmation) {
  std::lock_guard lock(mutex_);
  const auto now = Clock::now();
  for (Running& running : running_) {
    if (!running.overdue_since && now - running.since > limit) running.overdue_since = now;
  }
  const auto last = std::find_if(running_.rbegin(), running_.rend(), [&](const Running& running) {
    return running.overdue_since && now - *running.overdue_since >= confirmation;
  });
  if (last == running_.rend()) return std::nullopt;
  return StageHang{.stage = last->stage,
                   .since_s = std::chrono::duration<double>(now - last->since).count(),
                   .stack = StackOf(last->thread)};
}

}  // namespace romap::session
