#include "client/cli/map_collector.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/printable.h"

namespace romap::cli {
namespace {

constexpr size_t kMaxFaults = 5;

// The file that an error of the server is about: its message starts with the field of the frame.
const std::string& FileOf(const std::string& error, const files::FramePaths& paths) {
  return error.starts_with("masks:") ? paths.mask : error.starts_with("depth:") ? paths.depth : paths.image;
}

}  // namespace

double MapCollector::Now_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

void MapCollector::NoteSent(uint64_t frame_id, int64_t timestamp_ns, bool has_masks, bool has_pose,
                            files::FramePaths paths) {
  if (sent_.empty()) first_sent_s_ = Now_s();
  sent_[frame_id] = {timestamp_ns, Now_s(), std::move(paths)};
  if (has_masks) ++sent_with_masks_;
  if (has_pose) ++sent_with_pose_;
}

double MapCollector::SentAt_s(uint64_t frame_id) const {
  const auto it = sent_.find(frame_id);
  return it == sent_.end() ? 0 : it->second.time_s;
}

void MapCollector::ApplyAck(const FrameAck& ack) {
  ++acknowledged_;
  last_ack_s_ = Now_s();
  latencies_s_.push_back(ack.latency_s);
  if (!ack.accepted) {
    ++rejected_;
    NoteFault("frame", ack.frame_id, ack.error);
    return;
  }
  if (ack.is_keyframe) ++keyframes_;
  tracking_.initializing += ack.state == TrackingState::kInitializing ? 1 : 0;
  tracking_.lost += ack.state == TrackingState::kLost ? 1 : 0;
  tracking_.relocalized += ack.state == TrackingState::kRelocalized ? 1 : 0;
  tracking_.tracked += ack.T_world_camera ? 1 : 0;
  tracking_.rotation_only += ack.R_world_camera ? 1 : 0;
  if (!ack.T_world_camera) tracking_.last_reason = ack.state_reason;
  const auto sent = sent_.find(ack.frame_id);
  if (ack.T_world_camera && sent != sent_.end()) {
    trajectory_.push_back({sent->second.timestamp_ns, *ack.T_world_camera, ack.uncertainty});
  }
}

void MapCollector::ApplyMasksAck(const MasksAck& ack) {
  ++late_masks_.acknowledged;
  if (ack.accepted) return;
  ++late_masks_.rejected;
  NoteFault("late masks of frame", ack.frame_id, ack.error);
}

void MapCollector::NoteFault(const std::string& what, uint64_t frame_id, const std::string& error) {
  if (faults_.size() >= kMaxFaults) return;
  const auto sent = sent_.find(frame_id);
  const std::string file = sent == sent_.end() ? "" : FileOf(error, sent->second.paths);
  faults_.push_back(
      fmt::format("{} {}{}: {}", what, frame_id, file.empty() ? "" : fmt::format(" ({})", file), Printable(error)));
}

void MapCollector::Apply(const MapEvent& event) {
  map_.Apply(event);
  if (const auto* ack = std::get_if<FrameAck>(&event)) {
    ApplyAck(*ack);
  } else if (const auto* masks = std::get_if<MasksAck>(&event)) {
    ApplyMasksAck(*masks);
  } else if (const auto* update = std::get_if<ObjectUpdate>(&event)) {
    double& first_cuboid_s = arrivals_[update->id].first_cuboid_s;
    if (first_cuboid_s < 0 && update->state != ObjectState::kProvisional) first_cuboid_s = Now_s();
  } else if (const auto* mesh = std::get_if<MeshUpdate>(&event)) {
    double& first_mesh_s = arrivals_[mesh->id].first_mesh_s;
    if (first_mesh_s < 0) first_mesh_s = Now_s();
  } else if (const auto* statistics = std::get_if<Statistics>(&event)) {
    statistics_ = *statistics;
    server_peak_bytes_ = std::max(server_peak_bytes_, statistics->resident_bytes);
  }
}

MapCollector::Arrival MapCollector::ArrivalOf(ObjectId id) const {
  const auto it = arrivals_.find(id);
  return it == arrivals_.end() ? Arrival{} : it->second;
}

size_t MapCollector::ConfirmedObjects() const {
  return std::count_if(objects().begin(), objects().end(),
                       [](const auto& entry) { return entry.second.object.state != ObjectState::kProvisional; });
}

std::vector<files::StampedPose> MapCollector::Trajectory() const { return trajectory_; }

}  // namespace romap::cli
