#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/files/sequence.h"
#include "client/files/tum.h"
#include "client/sdk/map_copy.h"
#include "common/map_events.h"

namespace romap::cli {

// Collects the events of a run: a copy of the map, the acknowledgements, and arrival times. Times are seconds since
// construction. Not thread-safe.
class MapCollector {
 public:
  struct Arrival {
    double first_cuboid_s = -1;  // of the first confirmed cuboid; -1 = none so far
    double first_mesh_s = -1;
  };

  // Call before sending a frame, or the late masks of a frame. `paths`: the files of the frame, for messages.
  void NoteSent(uint64_t frame_id, int64_t timestamp_ns, bool has_masks, bool has_pose = false,
                files::FramePaths paths = {});
  void NoteLateMasksSent() { ++late_masks_.sent; }
  void Apply(const MapEvent& event);

  double Now_s() const;
  const std::map<ObjectId, ObjectSnapshot>& objects() const { return map_.objects(); }
  Arrival ArrivalOf(ObjectId id) const;
  size_t ConfirmedObjects() const;
  // Poses of the accepted frames, in order of acknowledgement.
  std::vector<files::StampedPose> Trajectory() const;
  const std::optional<Statistics>& statistics() const { return statistics_; }
  size_t sent() const { return sent_.size(); }
  size_t acknowledged() const { return acknowledged_; }
  size_t rejected() const { return rejected_; }
  size_t keyframes() const { return keyframes_; }
  // Tracking states of the accepted frames.
  struct Tracking {
    size_t initializing = 0, tracked = 0, lost = 0, relocalized = 0;  // relocalized frames also count as tracked
    size_t rotation_only = 0;                                         // of those that are not tracked
    std::string last_reason;  // why tracking failed most recently; empty = never
  };
  const Tracking& tracking() const { return tracking_; }
  struct LateMasks {
    size_t sent = 0, acknowledged = 0, rejected = 0;  // rejected masks also count as acknowledged
  };
  size_t sent_with_masks() const { return sent_with_masks_; }
  size_t sent_with_pose() const { return sent_with_pose_; }
  const LateMasks& late_masks() const { return late_masks_; }
  // Messages of the first few rejected frames and masks, with the file that each is about.
  const std::vector<std::string>& faults() const { return faults_; }
  // Peak memory of the server as reported by its statistics [bytes]; 0 = not reported.
  uint64_t server_peak_bytes() const { return server_peak_bytes_; }
  double last_ack_s() const { return last_ack_s_; }
  double first_sent_s() const { return first_sent_s_; }
  double SentAt_s(uint64_t frame_id) const;
  std::vector<double> latencies_s() const { return latencies_s_; }

 private:
  struct Sent {
    int64_t timestamp_ns = 0;
    double time_s = 0;
    files::FramePaths paths = {};
  };

  void ApplyAck(const FrameAck& ack);
  void ApplyMasksAck(const MasksAck& ack);
  void NoteFault(const std::string& what, uint64_t frame_id, const std::string& error);

  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::map<uint64_t, Sent> sent_;
  client::MapCopy map_;
  std::map<ObjectId, Arrival> arrivals_;
  std::vector<files::StampedPose> trajectory_;
  std::vector<double> latencies_s_;
  std::vector<std::string> faults_;
  std::optional<Statistics> statistics_;
  Tracking tracking_;
  LateMasks late_masks_;
  size_t sent_with_masks_ = 0, sent_with_pose_ = 0, acknowledged_ = 0, rejected_ = 0, keyframes_ = 0;
  uint64_t server_peak_bytes_ = 0;
  double last_ack_s_ = 0, first_sent_s_ = 0;
};

}  // namespace romap::cli
