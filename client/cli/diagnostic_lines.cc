#include "client/cli/diagnostic_lines.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "client/cli/format_diagnostic.h"

namespace romap::cli {
namespace {

std::string CodeAndCount(const Diagnostic& diagnostic) {
  return diagnostic.count > 1 ? fmt::format("{} ({} times)", diagnostic.code, diagnostic.count) : diagnostic.code;
}

// "2 warnings: images_dark, file_unreadable (3 times)". Empty if no diagnostic has the severity.
std::string FormatSeverity(const std::vector<Diagnostic>& diagnostics, Severity severity) {
  std::vector<std::string> codes;
  for (const Diagnostic& diagnostic : diagnostics) {
    if (diagnostic.severity == severity) codes.push_back(CodeAndCount(diagnostic));
  }
  if (codes.empty()) return "";
  const char* plural = codes.size() > 1 && severity != Severity::kInfo ? "s" : "";
  return fmt::format("{} {}{}: {}", codes.size(), SeverityName(severity), plural, fmt::join(codes, ", "));
}

}  // namespace

void DiagnosticLines::Say(const Diagnostic& diagnostic) {
  std::lock_guard lock(mutex_);
  said_.push_back(diagnostic);
  say_(FormatDiagnostic(diagnostic));
}

void DiagnosticLines::SayNews(const Diagnostic& diagnostic, Clock::time_point now) {
  std::lock_guard lock(mutex_);
  SayNewsLocked(diagnostic, now);
}

void DiagnosticLines::SayPresent(const std::vector<Diagnostic>& present, Clock::time_point now) {
  std::lock_guard lock(mutex_);
  std::erase_if(first_seen_, [&](const auto& entry) {
    return std::ranges::none_of(present, [&](const Diagnostic& d) { return d.code == entry.first; });
  });
  for (const Diagnostic& diagnostic : present) SayNewsLocked(diagnostic, now);
}

void DiagnosticLines::SayNewsLocked(const Diagnostic& diagnostic, Clock::time_point now) {
  const bool is_known = std::ranges::any_of(said_, [&](const Diagnostic& known) {
    return known.code == diagnostic.code && known.severity >= diagnostic.severity;
  });
  if (is_known) return;
  if (diagnostic.severity == Severity::kWarning && diagnostic.first_frame_id == 0) {
    const auto [seen, is_new] = first_seen_.try_emplace(diagnostic.code, now);
    if (now - seen->second < kMinPresence) return;
  }
  said_.push_back(diagnostic);
  say_(FormatDiagnostic(diagnostic));
}

std::vector<Diagnostic> DiagnosticLines::Said() const {
  std::lock_guard lock(mutex_);
  return said_;
}

std::string FormatFinalDiagnostics(const std::vector<Diagnostic>& diagnostics, const std::vector<Diagnostic>& said) {
  std::string text;
  for (const Diagnostic& diagnostic : diagnostics) {
    const bool is_said = std::ranges::any_of(said, [&](const Diagnostic& known) {
      return known.code == diagnostic.code && known.severity == diagnostic.severity &&
             known.advice == diagnostic.advice;
    });
    if (!is_said) text += FormatDiagnostic(diagnostic) + "\n";
  }
  std::vector<std::string> parts;
  for (const Severity severity : {Severity::kError, Severity::kWarning, Severity::kInfo}) {
    if (std::string part = FormatSeverity(diagnostics, severity); !part.empty()) parts.push_back(std::move(part));
  }
  std::vector<std::string> passed;
  for (const Diagnostic& known : said) {
    const auto has_code = [&](const Diagnostic& diagnostic) { return diagnostic.code == known.code; };
    if (std::ranges::any_of(diagnostics, has_code) || std::ranges::count(passed, known.code) > 0) continue;
    passed.push_back(known.code);
  }
  if (!passed.empty()) parts.push_back(fmt::format("no longer the case: {}", fmt::join(passed, ", ")));
  if (!parts.empty()) text += fmt::format("diagnostics: {}\n", fmt::join(parts, "; "));
  return text;
}

}  // namespace romap::cli
