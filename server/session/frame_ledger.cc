#include "server/session/frame_ledger.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "common/status.h"

namespace romap::session {
namespace {

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

bool IsPowerOfTen(uint64_t count) {
  while (count > 1 && count % 10 == 0) count /= 10;
  return count == 1;
}

}  // namespace

void FrameLedger::CountReceived(bool is_frame) {
  ++inputs_received_;
  if (!is_frame) return;
  ++frames_received_;
  if (counters_ != nullptr) counters_->CountReceived();
}

void FrameLedger::AcknowledgeFrame(const Arrival& arrival, const TrackedFrame& tracked) {
  const FrameInput& input = std::get<FrameInput>(arrival.input);
  const bool has_pose = tracked.state == TrackingState::kTracking || tracked.state == TrackingState::kRelocalized;
  FrameAck ack;
  ack.frame_id = input.frame_id;
  ack.state = tracked.state;
  if (has_pose) {
    ack.T_world_camera = tracked.T_world_camera;
    ack.map_id = tracked.map;
  }
  if (!has_pose) ack.R_world_camera = tracked.R_world_camera;
  ack.is_keyframe = tracked.is_keyframe;
  ack.latency_s = SecondsSince(arrival.time);
  if (counters_ != nullptr) counters_->CountAcknowledged(ack.latency_s);
  ack.state_reason = tracked.reason;
  ack.uncertainty = tracked.uncertainty;
  {
    std::lock_guard lock(mutex_);
    newest_frame_id_ = input.frame_id;
  }
  map_->Acknowledge(std::move(ack), input.timestamp_ns, tracked.reference, tracked.T_reference_camera,
                    tracked.reference_uncertainty);
}

void FrameLedger::AcknowledgeMasks(const FrameMasks& masks) { map_->Acknowledge(MasksAck{.frame_id = masks.frame_id}); }

void FrameLedger::AcknowledgeDuplicate(const Arrival& arrival) {
  if (const auto* masks = std::get_if<MasksInput>(&arrival.input)) {
    map_->Acknowledge(MasksAck{.frame_id = masks->frame_id, .duplicate = true});
  } else {
    const FrameInput& frame = std::get<FrameInput>(arrival.input);
    --frames_received_;  // it was counted before
    FrameAck ack;
    ack.frame_id = frame.frame_id;
    ack.duplicate = true;
    map_->Acknowledge(std::move(ack), frame.timestamp_ns);
  }
  Settle();
}

bool FrameLedger::IsSettled() const {
  std::lock_guard lock(mutex_);
  return all_settled_ || inputs_settled_ >= inputs_received_;
}

std::optional<uint64_t> FrameLedger::newest_frame_id() const {
  std::lock_guard lock(mutex_);
  return newest_frame_id_;
}

void FrameLedger::Reject(const Arrival& arrival, const absl::Status& reason) {
  if (const auto* frame = std::get_if<FrameInput>(&arrival.input)) {
    if (counters_ != nullptr) counters_->CountRejected();
    LogRejection("frame", frame->frame_id, ++frames_rejected_, reason);
  } else {
    LogRejection("masks of frame", std::get<MasksInput>(arrival.input).frame_id, ++masks_rejected_, reason);
  }
  SendRejection(arrival, Message(reason), TrackingState::kLost);
}

void FrameLedger::LogRejection(const char* input, uint64_t frame_id, uint64_t count, const absl::Status& reason) const {
  if (!IsPowerOfTen(count)) return;
  spdlog::info("session {}: {} {} rejected{}: {}", session_id_, input, frame_id,
               count > 1 ? fmt::format(", the {}th", count) : "", Message(reason));
}

void FrameLedger::Drop(const Arrival& arrival) {
  if (std::holds_alternative<FrameInput>(arrival.input)) {
    ++frames_dropped_;
    if (counters_ != nullptr) counters_->CountDropped();
  }
  SendRejection(arrival, "dropped: the server cannot keep up with the live stream", TrackingState::kTracking);
}

void FrameLedger::SendRejection(const Arrival& arrival, std::string reason, TrackingState state) {
  if (const auto* masks = std::get_if<MasksInput>(&arrival.input)) {
    map_->Acknowledge(MasksAck{.frame_id = masks->frame_id, .accepted = false, .error = std::move(reason)});
  } else {
    const FrameInput& frame = std::get<FrameInput>(arrival.input);
    FrameAck ack;
    ack.frame_id = frame.frame_id;
    ack.accepted = false;
    ack.error = std::move(reason);
    ack.state = state;
    ack.latency_s = SecondsSince(arrival.time);
    map_->Acknowledge(std::move(ack), frame.timestamp_ns);
  }
  Settle();
}

void FrameLedger::CountMappedFrame(bool is_keyframe, size_t map_points) {
  if (is_keyframe) ++keyframes_;
  map_points_ = map_points;
  ++frames_processed_;
  if (counters_ != nullptr) counters_->CountProcessed();
  Settle();
}

void FrameLedger::Settle() {
  std::vector<std::function<void()>> due;
  {
    std::lock_guard lock(mutex_);
    ++inputs_settled_;
    const auto end = waiters_.upper_bound(inputs_settled_);
    for (auto it = waiters_.begin(); it != end; ++it) due.push_back(std::move(it->second));
    waiters_.erase(waiters_.begin(), end);
  }
  for (const auto& done : due) done();
}

void FrameLedger::SettleAll() {
  std::multimap<uint64_t, std::function<void()>> due;
  {
    std::lock_guard lock(mutex_);
    all_settled_ = true;
    due.swap(waiters_);
  }
  for (const auto& [target, done] : due) done();
}

void FrameLedger::WhenSettled(std::function<void()> done) {
  {
    std::lock_guard lock(mutex_);
    const uint64_t target = inputs_received_;
    if (!all_settled_ && inputs_settled_ < target) {
      waiters_.emplace(target, std::move(done));
      return;
    }
  }
  done();
}

void FrameLedger::FillIn(Statistics* statistics) const {
  statistics->frames_received = frames_received_;
  statistics->frames_processed = frames_processed_;
  statistics->frames_dropped = frames_dropped_;
  statistics->frames_rejected = frames_rejected_;
  statistics->keyframes = keyframes_;
  statistics->map_points = map_points_;
}

}  // namespace romap::session
