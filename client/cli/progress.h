#pragma once

#include <chrono>
#include <mutex>
#include <string>

namespace romap::cli {

// A progress bar on stderr. Redraws the line in place on a terminal; otherwise prints a line every few seconds.
// Thread-safe.
class Progress {
 public:
  // Share of the frames in the fraction, where training follows.
  static constexpr double kFrameFraction = 0.6;

  explicit Progress(std::string title);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // Shows the completed `fraction` (0..1), `text`, and an estimate of the remaining time if available.
  void Show(double fraction, const std::string& text);
  // Prints a line of its own.
  void Say(const std::string& text);
  // Ends the progress bar; the last line stays visible.
  void Done();

 private:
  using Clock = std::chrono::steady_clock;

  std::mutex mutex_;
  std::string title_;
  bool terminal_;
  bool shown_ = false;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace romap::cli
