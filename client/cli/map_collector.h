#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/files/tum.h"
#include "client/sdk/map_copy.h"
#include "common/map_events.h"

namespace romap::cli {

// What a run keeps of its stream: a copy of the map, the answers to what was sent, and when things arrived. Times are
// seconds on a steady clock, from construction.
class MapCollector {
 public:
  struct Arrival {
    double first_cuboid_s = -1;  // confirmed, with a cuboid; -1 = not yet
    double first_mesh_s = -1;
  };

  // Call before the frame, or the masks that come after their frame, are handed over.
  void NoteSent(uint64_t frame_id, int64_t timestamp_ns, bool has_masks);
  void NoteLateMasksSent() { ++late_masks_.sent; }
  void Apply(const MapEvent& event);

  double Now_s() const;
  const std::map<ObjectId, ObjectSnapshot>& objects() const { return map_.objects(); }
  Arrival ArrivalOf(ObjectId id) const;
  size_t ConfirmedObjects() const;
  // Accepted frames with a pose, in the order they were acknowledged.
  std::vector<files::StampedPose> Trajectory() const;
  const std::optional<Statistics>& statistics() const { return statistics_; }
  size_t sent() const { return sent_.size(); }
  size_t acknowledged() const { return acknowledged_; }
  size_t rejected() const { return rejected_; }
  size_t keyframes() const { return keyframes_; }
  // How the camera was followed, over the accepted frames.
  struct Tracking {
    size_t initialising = 0, tracked = 0, lost = 0, relocalised = 0;  // the relocalised ones count as tracked too
    std::string last_reason;  // why the last frame that was not tracked was not; empty: all were
  };
  const Tracking& tracking() const { return tracking_; }
  struct LateMasks {
    size_t sent = 0, acknowledged = 0, rejected = 0;  // the rejected ones count as acknowledged too
  };
  size_t sent_with_masks() const { return sent_with_masks_; }
  const LateMasks& late_masks() const { return late_masks_; }
  const std::vector<std::string>& faults() const { return faults_; }  // the first few, for people
  // The most that a server's statistics reported; 0 = none came.
  uint64_t server_peak_bytes() const { return server_peak_bytes_; }
  double last_ack_s() const { return last_ack_s_; }
  double first_sent_s() const { return first_sent_s_; }
  double SentAt_s(uint64_t frame_id) const;
  std::vector<double> latencies_s() const { return latencies_s_; }

 private:
  struct Sent {
    int64_t timestamp_ns = 0;
    double time_s = 0;
  };

  void ApplyAck(const FrameAck& ack);
  void ApplyMasksAck(const MasksAck& ack);
  void NoteFault(std::string fault);

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
  size_t sent_with_masks_ = 0, acknowledged_ = 0, rejected_ = 0, keyframes_ = 0;
  uint64_t server_peak_bytes_ = 0;
  double last_ack_s_ = 0, first_sent_s_ = 0;
};

}  // namespace romap::cli
