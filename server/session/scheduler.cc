#include "server/session/scheduler.h"

#include <fmt/format.h>

#include <exception>
#include <optional>
#include <utility>
#include <variant>

#include "common/log_context.h"
#include "common/thread_time.h"

namespace romap::session {
namespace {

// Single thread: number of training slices after each keyframe, about as many as two cores train between two keyframes.
constexpr int kSlicesPerKeyframe = 4;

constexpr std::chrono::milliseconds kTrainingPollPeriod{20};

// Decoded inputs that wait for tracking: enough that it never waits for the decoder.
constexpr size_t kCheckedQueue = 2;

bool IsResent(const SessionInput& input) {
  return std::visit([](const auto& content) { return content.resent; }, input);
}

}  // namespace

Scheduler::Scheduler(const std::string& session_id, const SessionConfig& config, FrameMode mode, Pipeline* pipeline,
                     FrameLedger* ledger, Callbacks callbacks)
    : config_(config),
      mode_(mode),
      pipeline_(pipeline),
      ledger_(ledger),
      callbacks_(std::move(callbacks)),
      inputs_(config.frame_queue),
      checked_(kCheckedQueue),
      steps_(config.mapping_queue) {
  const auto start = [&](void (Scheduler::*run)()) {
    return std::thread([this, run, session_id] {
      const LogContext context(session_id);
      (this->*run)();
    });
  };
  try {
    if (config_.single_thread) {
      tracking_thread_ = start(&Scheduler::RunSingleThread);
    } else {
      ingest_thread_ = start(&Scheduler::RunIngest);
      tracking_thread_ = start(&Scheduler::RunTracking);
      mapping_thread_ = start(&Scheduler::RunMapping);
    }
  } catch (...) {  // the process has no more threads or memory
    Stop();
    throw;
  }
}

template <class Work>
void Scheduler::Measure(bool is_live, const Work& work) {
  const double start_s = ThreadCpuSeconds();
  work();
  if (is_live) live_load_.Add(ThreadCpuSeconds() - start_s, std::chrono::steady_clock::now());
}

bool Scheduler::IsLive(const SessionInput& input) const {
  return mode_ == FrameMode::kLive && !restoring_ && !IsResent(input);
}

bool Scheduler::Offer(SessionInput input) {
  const bool is_resent = IsResent(input);
  // A live input must not push a resent one out of the queue.
  const bool may_drop = IsLive(input) && resent_waiting_ == 0;
  if (is_resent) ++resent_waiting_;
  const bool is_frame = std::holds_alternative<FrameInput>(input);
  Arrival arrival{std::move(input), std::chrono::steady_clock::now()};
  bool accepted = false;
  std::optional<Arrival> dropped;
  if (!may_drop) {
    accepted = inputs_.Push(std::move(arrival));
  } else {
    dropped = inputs_.PushDroppingOldest(std::move(arrival), &accepted);
  }
  if (accepted) ledger_->CountReceived(is_frame);
  if (dropped) ledger_->Drop(*dropped);
  return accepted;
}

void Scheduler::Stop() {
  stopping_ = true;
  pipeline_->StopChecks();
  inputs_.Close();
  checked_.Close();
  steps_.Close();
  if (ingest_thread_.joinable()) ingest_thread_.join();
  if (tracking_thread_.joinable()) tracking_thread_.join();
  if (mapping_thread_.joinable()) mapping_thread_.join();
}

void Scheduler::RunIngest() {
  try {
    while (std::optional<Arrival> arrival = inputs_.Pop()) {
      if (IsResent(arrival->input)) --resent_waiting_;
      if (stopping_) continue;
      CheckedInput checked;
      Measure(IsLive(arrival->input), [&] { checked = pipeline_->Check(*std::move(arrival)); });
      checked_.Push(std::move(checked));
    }
  } catch (const std::exception& e) {
    Fail("ingest", e.what());
  }
  checked_.Close();
}

void Scheduler::RunTracking() {
  try {
    while (const std::optional<CheckedInput> input = checked_.Pop()) {
      if (stopping_) continue;
      const bool is_live = IsLive(input->arrival.input);
      Measure(is_live, [&] {
        const StageWatch::Scope scope(&watch_, "tracking");
        pipeline_->Process(
            *input, [&](MappingStep step) { is_live ? ExecuteLive(std::move(step)) : ExecuteReplay(std::move(step)); });
      });
    }
  } catch (const std::exception& e) {
    Fail("tracking", e.what());
  }
  steps_.Close();
}

void Scheduler::RunMapping() {
  const auto period = std::chrono::milliseconds(static_cast<int64_t>(1000 * config_.statistics_period_s));
  try {
    while (!steps_.Drained()) {
      if (const std::optional<QueuedStep> step = steps_.PopFor(period)) RunStep(*step);
      callbacks_.tick();
    }
    EndMapping();
    TrainToCompletion();
  } catch (const std::exception& e) {
    Fail("mapping", e.what());
    EndMapping();
  }
}

void Scheduler::RunSingleThread() {
  const Pipeline::MappingExecutor execute = [this](const MappingStep& step) { ExecuteImmediately(step); };
  try {
    while (std::optional<Arrival> arrival = inputs_.Pop()) {
      if (IsResent(arrival->input)) --resent_waiting_;
      if (!stopping_) pipeline_->Process(pipeline_->Check(*std::move(arrival)), execute);
      callbacks_.tick();
    }
    EndMapping();
    TrainToCompletion();
  } catch (const std::exception& e) {
    Fail("mapping", e.what());
    EndMapping();
  }
}

void Scheduler::ExecuteImmediately(const MappingStep& step) {
  step.run();
  if (step.is_keyframe) pipeline_->TrainSlices(kSlicesPerKeyframe);
}

void Scheduler::ExecuteReplay(MappingStep step) {
  const bool changes_local_map = step.changes_local_map;
  if (changes_local_map) {
    std::lock_guard lock(mutex_);
    ++map_changes_waiting_;
  }
  if (!steps_.Push({std::move(step), /*is_live=*/false}) || !changes_local_map) return;
  std::unique_lock lock(mutex_);
  local_map_changed_.wait(lock, [&] { return map_changes_waiting_ == 0 || mapping_ended_; });
}

void Scheduler::ExecuteLive(MappingStep step) {
  if (step.is_keyframe) pipeline_->SetKeyframesWait(++keyframes_waiting_ > 0);
  // An older lost frame would be relocalized too late.
  if (step.relocalizes && lost_frames_waiting_ > 0) return ledger_->SkipMapping();
  if (step.relocalizes) ++lost_frames_waiting_;
  QueuedStep queued{std::move(step), /*is_live=*/true};
  if (steps_.TryPush(queued)) return;
  if (queued.step.relocalizes) --lost_frames_waiting_;
  if (queued.step.may_be_skipped) return ledger_->SkipMapping();
  // Tracking never waits for keyframes: it makes no more of them while several wait. Clients that send masks faster
  // than they are mapped have to wait.
  if (queued.step.is_keyframe || queued.step.changes_local_map) {
    steps_.ForcePush(std::move(queued));
  } else {
    steps_.Push(std::move(queued));
  }
}

void Scheduler::RunStep(const QueuedStep& queued) {
  const MappingStep& step = queued.step;
  if (queued.is_live && step.is_keyframe) pipeline_->SetKeyframesWait(--keyframes_waiting_ > 0);
  if (queued.is_live && step.relocalizes) --lost_frames_waiting_;
  if (!stopping_) {
    const StageWatch::Scope scope(&watch_, "mapping");
    Measure(queued.is_live, step.run);
  }
  if (!queued.is_live && step.changes_local_map) {
    std::lock_guard lock(mutex_);
    --map_changes_waiting_;
    local_map_changed_.notify_all();
  }
}

void Scheduler::EndMapping() {
  {
    std::lock_guard lock(mutex_);
    mapping_ended_ = true;
    local_map_changed_.notify_all();
  }
  ledger_->SettleAll();
}

void Scheduler::TrainToCompletion() {
  if (failed_ || stopping_) return;
  pipeline_->FinishMapping();
  while (!stopping_ && !pipeline_->IsTrainingDone()) {
    if (config_.single_thread) {
      pipeline_->TrainSlices(1);
    } else {
      std::this_thread::sleep_for(kTrainingPollPeriod);
    }
    callbacks_.tick();
  }
  if (!stopping_) callbacks_.finished();
}

void Scheduler::Abandon(const StageHang& hang) {
  stopping_ = true;  // a thread that goes on after all ends soon
  Fail(hang.stage.c_str(), fmt::format("it did not end within {:.0f} s", hang.since_s));
  EndMapping();
}

void Scheduler::Fail(const char* stage, const std::string& what) {
  failed_ = true;
  inputs_.Close();
  checked_.Close();
  steps_.Close();
  callbacks_.failed(stage, what);
}

}  // namespace romap::session
