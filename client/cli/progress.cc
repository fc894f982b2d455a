#include "client/cli/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "common/printable.h"

namespace romap::cli {
namespace {

constexpr int kBarWidth = 24;
constexpr std::chrono::milliseconds kTerminalPeriod{100};
constexpr std::chrono::seconds kLogPeriod{5};

}  // namespace

Progress::Progress(std::string title)
    : title_(std::move(title)), terminal_(isatty(STDERR_FILENO) != 0), start_(Clock::now()), last_(start_) {}

Progress::~Progress() { Done(); }

void Progress::Say(const std::string& text) {
  std::lock_guard lock(mutex_);
  fmt::print(stderr, "{}romap: {}\n", shown_ && terminal_ ? "\r\x1b[2K" : "", PrintableLines(text));
  std::fflush(stderr);
  shown_ = false;
}

void Progress::Show(double fraction, const std::string& text) {
  std::lock_guard lock(mutex_);
  const Clock::time_point now = Clock::now();
  const Clock::duration period = terminal_ ? Clock::duration(kTerminalPeriod) : Clock::duration(kLogPeriod);
  if (now - last_ < period) return;
  last_ = now;
  fraction = std::clamp(fraction, 0.0, 1.0);
  const int filled = static_cast<int>(fraction * kBarWidth);
  const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
  std::string remaining;
  if (fraction > 0.02 && fraction < 1) {
    const double elapsed_s = std::chrono::duration<double>(now - start_).count();
    remaining = fmt::format(", {:.0f} s left", elapsed_s * (1 - fraction) / fraction);
  }
  const std::string line = fmt::format("{} [{}] {:3.0f} %  {}{}", title_, bar, 100 * fraction, text, remaining);
  fmt::print(stderr, "{}{}{}", terminal_ ? "\r\x1b[2K" : "", line, terminal_ ? "" : "\n");
  std::fflush(stderr);
  shown_ = true;
}

void Progress::Done() {
  std::lock_guard lock(mutex_);
  if (shown_ && terminal_) fmt::print(stderr, "\n");
  shown_ = false;
}

}  // namespace romap::cli
