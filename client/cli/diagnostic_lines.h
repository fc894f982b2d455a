#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "common/diagnostic.h"

namespace romap::cli {

// The diagnostics of a run on the terminal: each as one line when it arrives, and a short account at the end.
// Thread-safe.
class DiagnosticLines {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kMinPresence{5};

  // `say` prints a line, from any thread.
  explicit DiagnosticLines(std::function<void(const std::string&)> say) : say_(std::move(say)) {}

  // Prints a diagnostic of the client, which notes each once.
  void Say(const Diagnostic& diagnostic);
  // The same for one of the server. Prints a code when it first appears and when its severity rises. A warning about no
  // frame in particular concerns the present state of the map, which often improves while the map grows: it is printed
  // if SayPresent() has it `kMinPresence` later.
  void SayNews(const Diagnostic& diagnostic, Clock::time_point now = Clock::now());
  // All present ones of the server.
  void SayPresent(const std::vector<Diagnostic>& present, Clock::time_point now = Clock::now());

  // As they were printed, oldest first.
  std::vector<Diagnostic> Said() const;

 private:
  void SayNewsLocked(const Diagnostic& diagnostic, Clock::time_point now);

  const std::function<void(const std::string&)> say_;
  mutable std::mutex mutex_;
  std::vector<Diagnostic> said_;
  std::map<std::string, Clock::time_point> first_seen_;  // by code: of those that are not printed yet
};

// The final state of the diagnostics, as lines. In full are only those that were not `said` before, or whose severity
// or advice has changed since. One line has the codes of all, with their counts, and those that are no longer the case.
// Empty if there are none.
std::string FormatFinalDiagnostics(const std::vector<Diagnostic>& diagnostics, const std::vector<Diagnostic>& said);

}  // namespace romap::cli
