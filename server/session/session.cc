#include "server/session/session.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include "common/status.h"

namespace romap::session {
namespace {

int64_t UnixNow_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

uint64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  uint64_t pages_total = 0, pages_resident = 0;
  statm >> pages_total >> pages_resident;
  return pages_resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace

Session::Session(std::string id, const SessionOptions& options, const ServerConfig& config, nerf::TrainingPool* pool,
                 Mesher* mesher, std::unique_ptr<wire::RecordingWriter> recorder)
    : id_(std::move(id)),
      options_(options),
      config_(config.session),
      created_unix_ns_(UnixNow_ns()),
      lifecycle_(id_),
      ledger_(id_, &map_),
      diagnostics_(id_, &map_),
      pipeline_(id_, options, config, pool, mesher, &map_, &ledger_, &diagnostics_, std::move(recorder)),
      scheduler_(config.session, options.mode, &pipeline_, &ledger_, SchedulerCallbacks()) {}

Session::~Session() { Stop(absl::CancelledError("the session was closed")); }

Scheduler::Callbacks Session::SchedulerCallbacks() {
  return {.tick = [this] { PublishStatisticsIfDue(); },
          .finished = [this] { OnFinished(); },
          .failed = [this](const char* stage, const std::string& what) { OnFailed(stage, what); }};
}

absl::Status Session::Offer(SessionInput input) {
  if (scheduler_.Offer(std::move(input))) return absl::OkStatus();
  ROMAP_RETURN_IF_ERROR(CheckOpen());
  return FailedPrecondition("session '{}' was stopped and accepts no more frames", id_);
}

void Session::Finish() {
  lifecycle_.BeginFinish();
  scheduler_.CloseInputs();
}

void Session::OnFinished() {
  map_.Publish(CurrentStatistics());
  lifecycle_.Finish();
  map_.Close(absl::OkStatus());
}

void Session::OnFailed(const char* stage, const std::string& what) {
  const std::string cause = fmt::format("{} failed: {}", stage, what);
  diagnostics_.Report({.code = "session_failed",
                       .severity = Severity::kError,
                       .text = cause,
                       .advice = "export the map as it is, and start a new session"});
  lifecycle_.Fail(cause);
  map_.Close(Internal("session '{}': {}", id_, cause));
}

void Session::Stop(const absl::Status& status) {
  map_.Close(status);
  scheduler_.Stop();
}

void Session::PublishStatisticsIfDue() {
  const Clock::time_point now = Clock::now();
  if (now < next_statistics_) return;
  next_statistics_ =
      now + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(config_.statistics_period_s));
  map_.Publish(CurrentStatistics());
}

Statistics Session::CurrentStatistics() const {
  const nerf::TrainingPool::Progress training = pipeline_.TrainingProgress();
  Statistics statistics;
  ledger_.FillIn(&statistics);
  statistics.diagnostics = diagnostics_.Current();
  statistics.objects = map_.ConfirmedObjects();
  statistics.objects_training = static_cast<uint64_t>(std::max(0, training.objects_training));
  statistics.training_steps = training.steps;
  statistics.training_progress = training.progress;
  statistics.resident_bytes = ResidentBytes();
  return statistics;
}

SessionInfo Session::Info() const {
  SessionInfo info;
  info.id = id_;
  info.name = options_.name;
  info.camera = options_.camera;
  info.mode = options_.mode;
  info.state = lifecycle_.state();
  info.created_unix_ns = created_unix_ns_;
  info.stream_open = sender_.IsHeld();
  info.statistics = CurrentStatistics();
  return info;
}

MapSnapshot Session::Export() const {
  MapSnapshot snapshot = map_.Snapshot();
  snapshot.session_id = id_;
  snapshot.state = lifecycle_.state();
  snapshot.statistics = CurrentStatistics();
  return snapshot;
}

}  // namespace romap::session
