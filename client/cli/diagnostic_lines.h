#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "common/diagnostic.h"

namespace romap::cli {

// The diagnostics of a run on the terminal: each as one line when it arrives, and a short account at the end.
// Thread-safe.
class DiagnosticLines {
 public:
  // `say` prints a line, from any thread.
  explicit DiagnosticLines(std::function<void(const std::string&)> say) : say_(std::move(say)) {}

  // Prints a diagnostic of the client, which notes each once.
  void Say(const Diagnostic& diagnostic);
  // The same for one of the server, which repeats them. Prints a code when it first appears and when its severity
  // rises.
  void SayNews(const Diagnostic& diagnostic);

  // As they were printed, oldest first.
  std::vector<Diagnostic> Said() const;

 private:
  const std::function<void(const std::string&)> say_;
  mutable std::mutex mutex_;
  std::vector<Diagnostic> said_;
};

// The final state of the diagnostics, as lines. In full are only those that were not `said` before, or whose severity
// or advice has changed since. One line has the codes of all, with their counts, and those that are no longer the case.
// Empty if there are none.
std::string FormatFinalDiagnostics(const std::vector<Diagnostic>& diagnostics, const std::vector<Diagnostic>& said);

}  // namespace romap::cli
