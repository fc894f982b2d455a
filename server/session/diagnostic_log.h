#pragma once

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "common/diagnostic.h"
#include "server/session/map_state.h"

namespace romap::session {

// What is wrong with the input and the map of one session. The stages report two kinds: incidents, which are counted
// and stay, and conditions, which last until the stage withdraws them. Every code is sent to the clients as an event,
// and written to the log, when it first appears and when its severity rises. Thread-safe.
class DiagnosticLog {
 public:
  // `map` sends the events and outlives the log.
  DiagnosticLog(std::string session_id, MapState* map) : session_id_(std::move(session_id)), map_(map) {}

  // Adds an incident. It increases the count of an earlier one with the same code, whose text it replaces.
  void Report(Diagnostic incident);
  // Replaces the conditions of a stage.
  void SetConditions(const std::string& stage, std::vector<Diagnostic> conditions);

  // The incidents and the present conditions, by code. Codes are unique.
  std::vector<Diagnostic> Current() const;

 private:
  void Announce(const Diagnostic& diagnostic);

  const std::string session_id_;
  MapState* const map_;

  mutable std::mutex mutex_;
  std::map<std::string, Diagnostic> incidents_;                // by code
  std::map<std::string, std::vector<Diagnostic>> conditions_;  // by stage
  std::map<std::string, Severity> announced_;                  // by code
};

}  // namespace romap::session
