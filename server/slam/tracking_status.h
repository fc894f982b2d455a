#pragma once

#include <cstdint>

#include "common/stage_messages.h"

namespace romap::slam {

// State of tracking: initializing -> tracking <-> lost.
class TrackingStatus {
 public:
  bool IsLost() const { return state_ == TrackingState::kLost; }
  bool IsTracking() const { return state_ == TrackingState::kTracking; }
  // Lost, or relocalized so recently that the pose must still be confirmed by more points than usual.
  bool NeedsConfirmation() const { return IsLost() || frames_since_recovery_ < kConfirmationFrames; }
  // Frames tracked since the map was initialized or the camera was relocalized.
  int frames_since_recovery() const { return frames_since_recovery_; }
  // The first frame of the current loss, and its time stamp; valid only while lost.
  uint64_t lost_since_frame() const { return lost_since_frame_; }
  int64_t lost_since_ns() const { return lost_since_ns_; }

  void OnMapReset() { state_ = TrackingState::kInitializing; }
  void OnMapInitialized() {
    state_ = TrackingState::kTracking;
    frames_since_recovery_ = 0;
  }
  void OnGivenPose() { state_ = TrackingState::kTracking; }
  // Returns the state to report with the frame: kRelocalized for the first one after a loss.
  TrackingState OnTracked() {
    const bool was_lost = IsLost();
    frames_since_recovery_ = was_lost ? 0 : frames_since_recovery_ + 1;
    state_ = TrackingState::kTracking;
    return was_lost ? TrackingState::kRelocalized : TrackingState::kTracking;
  }
  void OnLost(uint64_t frame_id, int64_t timestamp_ns) {
    if (!IsLost()) {
      lost_since_frame_ = frame_id;
      lost_since_ns_ = timestamp_ns;
    }
    state_ = TrackingState::kLost;
  }

 private:
  static constexpr int kConfirmationFrames = 15;

  TrackingState state_ = TrackingState::kInitializing;
  int frames_since_recovery_ = 0;
  uint64_t lost_since_frame_ = 0;
  int64_t lost_since_ns_ = 0;
};

}  // namespace romap::slam
