#pragma once

#include <chrono>
#include <string>

namespace romap::cli {

// A line on stderr that a person can follow: rewritten in place on a terminal, printed now and then elsewhere.
class Progress {
 public:
  explicit Progress(std::string title);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // `fraction` 0..1 of the whole; `text` follows the bar. An estimate of the time left is added once there is one.
  void Show(double fraction, const std::string& text);
  // Leaves the last line standing.
  void Done();

 private:
  using Clock = std::chrono::steady_clock;

  std::string title_;
  bool terminal_;
  bool shown_ = false;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace romap::cli
