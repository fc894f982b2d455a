#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "common/map_events.h"
#include "common/stage_messages.h"
#include "server/session/arrival.h"
#include "server/session/map_state.h"
#include "server/session/service_counters.h"

namespace romap::session {

// Tracks the inputs (frames and late masks) of one session: counts them, acknowledges them to the client, and reports
// when all inputs received up to a point are settled. An input is settled when it is mapped, rejected, dropped or
// skipped. Thread-safe.
class FrameLedger {
 public:
  // `map` sends the acknowledgements and outlives the ledger, as do the `counters` of the service, which may be null.
  FrameLedger(std::string session_id, MapState* map, ServiceCounters* counters = nullptr)
      : session_id_(std::move(session_id)), map_(map), counters_(counters) {}

  const std::string& session_id() const { return session_id_; }

  void CountReceived(bool is_frame);

  // The acknowledgement of an accepted input.
  void AcknowledgeFrame(const Arrival& arrival, const TrackedFrame& tracked);
  void AcknowledgeMasks(const FrameMasks& masks);

  // Each of these settles one input. AcknowledgeDuplicate: the client sent it again, and it was accepted before.
  // Reject: malformed. Drop: the live queue was full. SkipMapping: acknowledged, but not mapped, because mapping cannot
  // keep up with a live stream.
  void AcknowledgeDuplicate(const Arrival& arrival);
  void Reject(const Arrival& arrival, const absl::Status& reason);
  void Drop(const Arrival& arrival);
  void SkipMapping() { Settle(); }
  void CountMappedFrame(bool is_keyframe, size_t map_points);
  void CountMappedMasks() { Settle(); }

  bool IsSettled() const;                           // all inputs
  std::optional<uint64_t> newest_frame_id() const;  // of the accepted frames

  // No further input will be settled.
  void SettleAll();
  // Calls `done` when all inputs received before this call are settled: immediately, or later on the thread that
  // settles the last of them.
  void WhenSettled(std::function<void()> done);

  // Sets the counters of frames, keyframes and map points.
  void FillIn(Statistics* statistics) const;

 private:
  // The 1st, 10th, 100th ..., because a client may send nothing else.
  void LogRejection(const char* input, uint64_t frame_id, uint64_t count, const absl::Status& reason) const;
  void SendRejection(const Arrival& arrival, std::string reason, TrackingState state);
  void Settle();

  const std::string session_id_;
  MapState* const map_;
  ServiceCounters* const counters_;

  std::atomic<uint64_t> inputs_received_ = 0;  // frames and late masks
  std::atomic<uint64_t> frames_received_ = 0, frames_processed_ = 0, frames_dropped_ = 0, frames_rejected_ = 0;
  std::atomic<uint64_t> masks_rejected_ = 0;
  std::atomic<uint64_t> keyframes_ = 0, map_points_ = 0;

  mutable std::mutex mutex_;
  std::optional<uint64_t> newest_frame_id_;
  uint64_t inputs_settled_ = 0;
  bool all_settled_ = false;
  std::multimap<uint64_t, std::function<void()>> waiters_;  // by the number of inputs that must be settled
};

}  // namespace romap::session
