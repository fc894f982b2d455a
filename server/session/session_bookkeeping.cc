// The part of Session that takes in what clients offer, answers for it, and keeps count.

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include "common/status.h"
#include "server/session/session.h"

namespace romap::session {
namespace {

uint64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  uint64_t pages_total = 0, pages_resident = 0;
  statm >> pages_total >> pages_resident;
  return pages_resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

double Seconds(std::chrono::steady_clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

}  // namespace

void Session::Acknowledge(const Arrival& arrival, const TrackedFrame& tracked) {
  const FrameInput& input = std::get<FrameInput>(arrival.input);
  const bool has_pose = tracked.state == TrackingState::kTracking || tracked.state == TrackingState::kRelocalized;
  FrameAck ack;
  ack.frame_id = input.frame_id;
  ack.state = tracked.state;
  if (has_pose) ack.T_world_camera = tracked.T_world_camera;
  ack.is_keyframe = tracked.is_keyframe;
  ack.latency_s = Seconds(Clock::now() - arrival.time);
  ack.state_reason = tracked.reason;
  map_.Acknowledge(std::move(ack), input.timestamp_ns, tracked.reference, tracked.T_reference_camera);
}

void Session::Reject(const Arrival& arrival, const std::string& why) {
  if (const auto* frame = std::get_if<FrameInput>(&arrival.input)) {
    ++frames_rejected_;
    spdlog::info("session {}: frame {} not accepted: {}", id_, frame->frame_id, why);
  } else {
    const uint64_t frame_id = std::get<MasksInput>(arrival.input).frame_id;
    spdlog::info("session {}: masks of frame {} not accepted: {}", id_, frame_id, why);
  }
  Refuse(arrival, why, TrackingState::kLost);
}

void Session::Drop(const Arrival& arrival) {
  if (std::holds_alternative<FrameInput>(arrival.input)) ++frames_dropped_;
  Refuse(arrival, "dropped: the server is behind the live stream", TrackingState::kTracking);
}

// The answer to what is not mapped.
void Session::Refuse(const Arrival& arrival, const std::string& why, TrackingState state) {
  if (const auto* masks = std::get_if<MasksInput>(&arrival.input)) {
    map_.Acknowledge(MasksAck{.frame_id = masks->frame_id, .accepted = false, .error = why});
  } else {
    const FrameInput& frame = std::get<FrameInput>(arrival.input);
    map_.Acknowledge({.frame_id = frame.frame_id,
                      .accepted = false,
                      .error = why,
                      .state = state,
                      .T_world_camera = std::nullopt,
                      .is_keyframe = false,
                      .latency_s = Seconds(Clock::now() - arrival.time)},
                     frame.timestamp_ns);
  }
  Settle();
}

// A disk that fails costs the recording, not the session.
void Session::Record(const SessionInput& input) {
  if (!recorder_) return;
  const absl::Status status = recorder_->Append(input);
  if (status.ok()) return;
  spdlog::error("session {}: its recording ends: {}", id_, Message(status));
  recorder_ = nullptr;
}

void Session::Fail(const char* stage, const std::string& what) {
  spdlog::error("session {}: {} failed, the session ends: {}", id_, stage, what);
  state_ = SessionState::kFailed;
  inputs_.Close();
  tracked_.Close();
  map_.Close(Internal("session {}: {} failed: {}", id_, stage, what));
}

absl::Status Session::Offer(SessionInput input) {
  const bool is_frame = std::holds_alternative<FrameInput>(input);
  Arrival arrival{std::move(input), Clock::now()};
  bool accepted = false;
  std::optional<Arrival> dropped;
  if (options_.mode == FrameMode::kReplay) {
    accepted = inputs_.Push(std::move(arrival));
  } else {
    dropped = inputs_.PushDroppingOldest(std::move(arrival), &accepted);
  }
  if (!accepted) return FailedPrecondition("session {} takes no more frames: it is finished", id_);
  ++offered_;
  if (is_frame) ++frames_received_;
  if (dropped) Drop(*dropped);
  return absl::OkStatus();
}

void Session::Finish() {
  SessionState open = SessionState::kOpen;
  state_.compare_exchange_strong(open, SessionState::kFinishing);
  inputs_.Close();
}

bool Session::AttachSender() { return !sender_attached_.exchange(true); }
void Session::DetachSender() { sender_attached_ = false; }

void Session::WhenDrained(std::function<void()> done) {
  {
    std::lock_guard lock(drain_mutex_);
    const uint64_t target = offered_;
    if (!all_settled_ && settled_ < target) {
      drain_waiters_.emplace(target, std::move(done));
      return;
    }
  }
  done();
}

void Session::Settle() {
  std::vector<std::function<void()>> due;
  {
    std::lock_guard lock(drain_mutex_);
    ++settled_;
    const auto end = drain_waiters_.upper_bound(settled_);
    for (auto it = drain_waiters_.begin(); it != end; ++it) due.push_back(std::move(it->second));
    drain_waiters_.erase(drain_waiters_.begin(), end);
  }
  for (const auto& done : due) done();
}

void Session::SettleAll() {
  std::multimap<uint64_t, std::function<void()>> due;
  {
    std::lock_guard lock(drain_mutex_);
    all_settled_ = true;
    map_changed_.notify_all();
    due.swap(drain_waiters_);
  }
  for (const auto& [target, done] : due) done();
}

void Session::PublishStatistics() {
  const Clock::time_point now = Clock::now();
  if (now < next_statistics_) return;
  next_statistics_ = now + std::chrono::duration_cast<Clock::duration>(
                               std::chrono::duration<double>(config_.session.statistics_period_s));
  map_.Publish(CurrentStatistics());
}

Statistics Session::CurrentStatistics() const {
  const nerf::TrainingPool::Progress progress = pool_->GetProgress(pool_client_);
  Statistics statistics;
  statistics.frames_received = frames_received_;
  statistics.frames_processed = frames_processed_;
  statistics.frames_dropped = frames_dropped_;
  statistics.frames_rejected = frames_rejected_;
  statistics.keyframes = keyframes_;
  statistics.map_points = map_points_;
  statistics.objects = map_.ConfirmedObjects();
  statistics.objects_training = static_cast<uint64_t>(std::max(0, progress.objects_training));
  statistics.training_steps = progress.steps;
  statistics.training_progress = progress.progress;
  statistics.resident_bytes = ResidentBytes();
  return statistics;
}

SessionInfo Session::Info() const {
  SessionInfo info;
  info.id = id_;
  info.name = options_.name;
  info.camera = options_.camera;
  info.mode = options_.mode;
  info.state = state_;
  info.created_unix_ns = created_unix_ns_;
  info.stream_open = sender_attached_;
  info.statistics = CurrentStatistics();
  return info;
}

MapSnapshot Session::Export() const {
  MapSnapshot snapshot = map_.Snapshot();
  snapshot.session_id = id_;
  snapshot.state = state_;
  snapshot.statistics = CurrentStatistics();
  return snapshot;
}

}  // namespace romap::session
