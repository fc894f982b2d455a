#include "server/session/session.h"

#include <malloc.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <future>
#include <utility>

#include "common/status.h"
#include "common/unix_time.h"

namespace romap::session {
namespace {

uint64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  uint64_t pages_total = 0, pages_resident = 0;
  statm >> pages_total >> pages_resident;
  return pages_resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace

Session::Session(std::string id, const SessionOptions& options, int64_t created_unix_ns, const ServerConfig& config,
                 const Services& services, SessionState state, std::shared_ptr<MapState> stored_map)
    : id_(std::move(id)),
      options_(options),
      config_(config.session),
      created_unix_ns_(created_unix_ns),
      store_(services.store),
      lifecycle_(id_, state),
      stored_map_(std::move(stored_map)),
      ledger_(id_, &map_, services.counters),
      diagnostics_(id_, &map_),
      storage_(store_ == nullptr ? nullptr
                                 : std::make_unique<SessionStorage>(store_, id_, options.mode, StoreListener())),
      pipeline_(options, config, services.pool, services.mesher, &map_, &ledger_, &diagnostics_,
                [this](const SessionInput& input) { OnAccepted(input); }),
      scheduler_(id_, config.session, options.mode, &pipeline_, &ledger_, SchedulerCallbacks()) {}

Session::Session(std::string id, const SessionOptions& options, int64_t created_unix_ns, const ServerConfig& config,
                 const Services& services, std::unique_ptr<wire::RecordingWriter> recorder)
    : Session(std::move(id), options, created_unix_ns, config, services, SessionState::kOpen, nullptr) {
  recorder_ = std::move(recorder);  // before the first input
  if (storage_) {
    map_.Publish(Durable{});
    storage_->Follow(&map_, {});
  }
}

Session::Session(std::string id, const SessionOptions& options, int64_t created_unix_ns, const ServerConfig& config,
                 const Services& services, Stored stored)
    : Session(std::move(id), options, created_unix_ns, config, services, SessionState::kRestoring, stored.map) {
  restoring_ = true;
  finish_after_restoring_ = stored.state == SessionState::kFinishing;
  stored_statistics_ = stored.statistics;
  pinned_ = stored.pinned;
  scheduler_.BeginRestoring();
  restore_thread_ = std::thread([this, moved = std::move(stored)]() mutable { Restore(std::move(moved)); });
}

Session::~Session() { Stop(absl::CancelledError("the session was closed")); }

Session::ReturnsMemory::~ReturnsMemory() { malloc_trim(0); }

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
  finish_after_restoring_ = true;
  if (lifecycle_.state() == SessionState::kRestoring) return;
  lifecycle_.BeginFinish();
  scheduler_.CloseInputs();
}

// A write error ends the recording, but not the session.
void Session::OnAccepted(const SessionInput& input) {
  if (storage_ && !restoring_) storage_->Append(input);
  if (!recorder_) return;
  const absl::Status status = recorder_->Append(input);
  if (status.ok()) return;
  spdlog::error("session {}: recording stopped: {}", id_, Message(status));
  recorder_ = nullptr;
}

store::Store::Listener Session::StoreListener() {
  return {
      .durable = [this](const Durable& durable) { map_.Publish(durable); },
      .trouble =
          [this](const absl::Status& status) {
            if (absl::IsDataLoss(status)) {
              diagnostics_.Report(
                  {.code = "inputs_not_stored",
                   .severity = Severity::kWarning,
                   .text = Message(status),
                   .advice = "the map is complete, but after a restart of the server it will lack them"});
              return;
            }
            std::vector<Diagnostic> conditions;
            if (!status.ok()) {
              conditions.push_back({.code = "not_durable",
                                    .severity = Severity::kWarning,
                                    .text = "the server cannot store the session now: " + Message(status),
                                    .advice = "the session continues in memory; make room on the disk of the server"});
            }
            diagnostics_.SetConditions("store", std::move(conditions));
          }};
}

// The restore thread.
void Session::Restore(Stored stored) {
  try {
    RestoreMap(std::move(stored));
  } catch (const std::exception& e) {
    OnFailed("restoring", e.what());
  }
}

void Session::RestoreMap(Stored stored) {
  OfferStoredInputs(stored.inputs);
  std::promise<void> settled;
  ledger_.WhenSettled([&] { settled.set_value(); });
  settled.get_future().wait();
  if (stopping_) return;
  map_.Replace(*stored_map_);
  map_.Publish(store_->DurableInputs(id_));
  storage_->Follow(&map_, stored.objects);
  restoring_ = false;
  scheduler_.EndRestoring();
  lifecycle_.EndRestoring();
  spdlog::info("session {}: restored from {} inputs, {} objects", id_, stored.inputs, map_.ConfirmedObjects());
  if (finish_after_restoring_) Finish();
}

void Session::OfferStoredInputs(uint64_t inputs) {
  for (uint64_t number = 1; number <= inputs && !stopping_; ++number) {
    absl::StatusOr<SessionInput> input = store_->LoadInput(id_, number);
    if (input.ok()) {
      if (!scheduler_.Offer(*std::move(input))) return;  // stopped or failed
      continue;
    }
    diagnostics_.Report(
        {.code = "stored_data_damaged",
         .severity = Severity::kWarning,
         .count = 1,
         .text = "a part of the stored session is damaged and was left out: " + Message(input.status())});
  }
}

void Session::StoreChanges(bool complete) {
  if (!storage_) return;
  storage_->StoreChanges([this] { return StateToStore(); }, complete);
}

void Session::StoreState() {
  if (storage_) storage_->StoreState([this] { return StateToStore(); });
}

SessionStorage::State Session::StateToStore() const {
  SessionState state = lifecycle_.state();
  if (state == SessionState::kRestoring) {
    state = finish_after_restoring_ ? SessionState::kFinishing : SessionState::kOpen;
  }
  return {state, lifecycle_.failure(), CurrentStatistics()};
}

std::shared_ptr<Outbox> Session::Subscribe(Outbox::Acks acks, size_t max_acks, std::vector<ObjectId>* objects) {
  // A stored map that was replaced meanwhile ends the subscription, and the client opens the stream again.
  return restoring_ ? stored_map_->Subscribe(acks, max_acks, objects) : map_.Subscribe(acks, max_acks, objects);
}

bool Session::IsIdle() const {
  // The storage is one subscriber.
  return !restoring_ && !sender_.IsHeld() && map_.Subscribers() <= (storage_ ? 1 : 0) && ledger_.IsSettled() &&
         pipeline_.TrainingProgress().objects_training == 0;
}

std::optional<double> Session::LiveCores() const {
  if (options_.mode != FrameMode::kLive || state() != SessionState::kOpen) return 0;
  const std::optional<double> cores = scheduler_.live_load().Cores(Clock::now());
  // A client opens its stream soon after it created the session.
  constexpr int64_t kPatience_ns = 30'000'000'000;
  const bool may_begin = sender_.IsHeld() || UnixNow_ns() - created_unix_ns_ < kPatience_ns;
  return may_begin ? cores : cores.value_or(0);
}

void Session::Unsubscribe(const std::shared_ptr<Outbox>& outbox) {
  if (stored_map_) stored_map_->Unsubscribe(outbox);
  map_.Unsubscribe(outbox);
}

void Session::OnFinished() {
  pipeline_.PublishPoints();
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

void Session::CheckStages() {
  if (config_.stage_timeout_s <= 0 || hangs_) return;
  constexpr std::chrono::seconds kConfirmation{5};
  const std::optional<StageHang> hang =
      scheduler_.FindHang(std::chrono::duration<double>(config_.stage_timeout_s), kConfirmation);
  if (!hang) return;
  hangs_ = true;
  stopping_ = true;
  spdlog::error("session {}: {} has been working on one frame for {:.0f} s (session.stage_timeout_s); its stack: {}",
                id_, hang->stage, hang->since_s, hang->stack);
  scheduler_.Abandon(*hang);
}

void Session::Stop(const absl::Status& status) {
  stopping_ = true;
  map_.Close(status);
  if (stored_map_) stored_map_->Close(status);
  scheduler_.Stop();
  if (restore_thread_.joinable()) restore_thread_.join();
}

void Session::PublishStatisticsIfDue() {
  const Clock::time_point now = Clock::now();
  if (now < next_statistics_) return;
  next_statistics_ =
      now + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(config_.statistics_period_s));
  map_.Publish(CurrentStatistics());
  pipeline_.PublishPoints();
}

Statistics Session::CurrentStatistics() const {
  if (restoring_) return stored_statistics_;
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
  info.tenant = options_.tenant;
  info.camera = options_.camera;
  info.mode = options_.mode;
  info.state = lifecycle_.state();
  info.created_unix_ns = created_unix_ns_;
  info.stream_open = sender_.IsHeld();
  info.statistics = CurrentStatistics();
  info.durable = is_durable();
  info.pinned = pinned_;
  if (store_ != nullptr) info.stored_bytes = store_->BytesOf(id_);
  return info;
}

MapSnapshot Session::Export() const {
  MapSnapshot snapshot = restoring_ ? stored_map_->Snapshot() : map_.Snapshot();
  snapshot.session_id = id_;
  snapshot.state = lifecycle_.state();
  snapshot.statistics = CurrentStatistics();
  return snapshot;
}

}  // namespace romap::session
