#include "server/session/diagnostic_log.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

namespace romap::session {

void DiagnosticLog::Report(Diagnostic incident) {
  std::lock_guard lock(mutex_);
  const auto [it, is_new] = incidents_.try_emplace(incident.code, incident);
  if (!is_new) {
    Diagnostic& known = it->second;
    known.count += incident.count;
    known.severity = std::max(known.severity, incident.severity);
    known.text = std::move(incident.text);
    known.advice = std::move(incident.advice);
  }
  Announce(it->second);
}

void DiagnosticLog::SetConditions(const std::string& stage, std::vector<Diagnostic> conditions) {
  std::lock_guard lock(mutex_);
  for (const Diagnostic& condition : conditions) Announce(condition);
  conditions_[stage] = std::move(conditions);
}

void DiagnosticLog::Announce(const Diagnostic& diagnostic) {
  const auto [it, is_new] = announced_.try_emplace(diagnostic.code, diagnostic.severity);
  if (!is_new && it->second >= diagnostic.severity) return;
  it->second = diagnostic.severity;
  // The same severity for all, because a program that maps in its own process shows them itself.
  spdlog::info("session {}: {}: {}{}{}", session_id_, diagnostic.code, diagnostic.text,
               diagnostic.advice.empty() ? "" : "; ", diagnostic.advice);
  map_->Publish(diagnostic);
}

std::vector<Diagnostic> DiagnosticLog::Current() const {
  std::lock_guard lock(mutex_);
  std::map<std::string, Diagnostic> current = incidents_;
  for (const auto& [stage, conditions] : conditions_) {
    for (const Diagnostic& condition : conditions) current.try_emplace(condition.code, condition);
  }
  std::vector<Diagnostic> diagnostics;
  diagnostics.reserve(current.size());
  for (auto& [code, diagnostic] : current) diagnostics.push_back(std::move(diagnostic));
  return diagnostics;
}

}  // namespace romap::session
