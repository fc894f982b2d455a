#include "client/cli/run_summary.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "client/cli/diagnostic_lines.h"
#include "client/cli/format_diagnostic.h"
#include "client/cli/format_length.h"
#include "client/cli/trackable.h"
#include "common/statistics.h"

namespace romap::cli {
namespace {

uint64_t PeakBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
}

std::string SecondsText(double seconds) { return seconds < 0 ? "-" : fmt::format("{:.2f} s", seconds); }

nlohmann::json Vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// The table of the objects. Its decimals suit the unit of the map and its columns the distance from the origin.
std::string FormatObjects(const std::vector<RunSummary::Object>& objects) {
  double largest = 0;
  for (const RunSummary::Object& object : objects) largest = std::max(largest, 2 * object.half_extents.maxCoeff());
  const int decimals = DecimalsFor(largest);
  std::vector<std::string> centers, sizes;
  size_t center_width = 24, size_width = 24;
  for (const RunSummary::Object& object : objects) {
    centers.push_back(FormatVector(object.center_world, " ", decimals));
    sizes.push_back(FormatVector(2 * object.half_extents, " x ", decimals));
    center_width = std::max(center_width, centers.back().size());
    size_width = std::max(size_width, sizes.back().size());
  }
  std::string text =
      fmt::format("{:<22} {:>{}} {:>{}} {:>9} {:>10} {:>12} {:>11}\n", "object", "center [map units]", center_width,
                  "size [map units]", size_width, "training", "triangles", "first cuboid", "first mesh");
  for (size_t i = 0; i < objects.size(); ++i) {
    const RunSummary::Object& object = objects[i];
    text += fmt::format("{:<22} {:>{}} {:>{}} {:>9} {:>10} {:>12} {:>11}\n", object.name, centers[i], center_width,
                        sizes[i], size_width, fmt::format("{:.2f} s", object.train_s), object.triangles,
                        SecondsText(object.first_cuboid_s), SecondsText(object.first_mesh_s));
  }
  return objects.empty() ? text + "(no objects mapped)\n" : text;
}

// The view that would add most to the map. Empty if none would add much.
std::string FormatNextView(const std::vector<RunSummary::Object>& objects) {
  constexpr double kMinStatedGain = 0.05;
  const RunSummary::Object* best = nullptr;
  for (const RunSummary::Object& object : objects) {
    if (object.next_view_world && (best == nullptr || object.next_view_gain > best->next_view_gain)) best = &object;
  }
  if (best == nullptr || best->next_view_gain < kMinStatedGain) return "";
  return fmt::format(
      "next view: {} from its side ({}), where {:.0f} % of its surface is visible that was observed "
      "badly\n",
      best->name, FormatVector(*best->next_view_world, " ", 2), 100 * best->next_view_gain);
}

}  // namespace

RunSummary Summarize(const files::Sequence& sequence, const StreamResult& stream, const MapCollector& collector,
                     const std::vector<MapObject>& objects) {
  RunSummary summary;
  summary.sequence = sequence.dir();
  summary.frames_sent = collector.sent();
  summary.frames_rejected = collector.rejected();
  summary.tracking = collector.tracking();
  summary.frames_with_masks = collector.sent_with_masks();
  summary.frames_with_pose = collector.sent_with_pose();
  summary.skipped_frames = stream.skipped_frames;
  summary.late_masks = collector.late_masks();
  summary.frames_accepted = collector.acknowledged() - collector.rejected();
  summary.keyframes = collector.keyframes();
  summary.mapping_s = stream.mapping_s;
  summary.training_s = stream.training_s;
  summary.frames_per_s = stream.mapping_s > 0 ? static_cast<double>(collector.acknowledged()) / stream.mapping_s : 0;
  summary.median_latency_ms = collector.latencies_s().empty() ? 0 : 1000 * Median(collector.latencies_s());
  summary.interrupted = stream.interrupted;
  summary.training_complete = stream.training_complete;
  summary.client_peak_bytes = PeakBytes();
  summary.server_peak_bytes = collector.server_peak_bytes();
  summary.diagnostics = sequence.diagnostics();
  const std::vector<Diagnostic> of_stream = DiagnosticsOf(stream, collector);
  summary.diagnostics.insert(summary.diagnostics.end(), of_stream.begin(), of_stream.end());
  summary.said = stream.said;
  if (collector.statistics()) {
    summary.frames_dropped = collector.statistics()->frames_dropped;
    summary.map_points = collector.statistics()->map_points;
  }
  summary.faults = collector.faults();

  const std::map<ObjectId, size_t> trackable = FirstTrackableFrames(sequence, collector.Trajectory(), objects);
  for (const MapObject& entry : objects) {
    RunSummary::Object object;
    object.name = entry.file_stem;
    object.class_name = entry.object.class_name;
    object.center_world = entry.object.cuboid.T_world_object.translation();
    object.half_extents = entry.object.cuboid.half_extents;
    object.observations = entry.object.observations;
    object.map_id = entry.object.map_id.value;
    object.steps = entry.steps;
    object.train_s = entry.train_seconds;
    object.vertices = entry.mesh.vertices.size();
    object.triangles = entry.mesh.triangles.size();
    if (entry.next_view) {
      object.next_view_world = entry.S_world_mesh.rotation() * entry.next_view->direction;
      object.next_view_gain = entry.next_view->gain;
    }
    const MapCollector::Arrival arrival = collector.ArrivalOf(entry.object.id);
    if (const auto it = trackable.find(entry.object.id); it != trackable.end()) {
      const double trackable_s = collector.SentAt_s(it->second + 1);  // frame ids count from 1
      if (arrival.first_cuboid_s >= 0) object.first_cuboid_s = std::max(0.0, arrival.first_cuboid_s - trackable_s);
      if (arrival.first_mesh_s >= 0) object.first_mesh_s = std::max(0.0, arrival.first_mesh_s - trackable_s);
    }
    summary.objects.push_back(object);
  }
  return summary;
}

nlohmann::json ToJson(const RunSummary& summary) {
  nlohmann::json objects = nlohmann::json::array();
  for (const RunSummary::Object& object : summary.objects) {
    objects.push_back({{"name", object.name},
                       {"class", object.class_name},
                       {"center_world_mu", Vector(object.center_world)},
                       {"half_extents_mu", Vector(object.half_extents)},
                       {"observations", object.observations},
                       {"map_id", object.map_id},
                       {"training_steps", object.steps},
                       {"training_s", object.train_s},
                       {"vertices", object.vertices},
                       {"triangles", object.triangles},
                       {"first_cuboid_s", object.first_cuboid_s},
                       {"first_mesh_s", object.first_mesh_s},
                       {"next_view_world", object.next_view_world ? Vector(*object.next_view_world) : nullptr},
                       {"next_view_gain", object.next_view_gain}});
  }
  nlohmann::json diagnostics = nlohmann::json::array();
  for (const Diagnostic& diagnostic : summary.diagnostics) {
    diagnostics.push_back({{"code", diagnostic.code},
                           {"severity", SeverityName(diagnostic.severity)},
                           {"first_frame_id", diagnostic.first_frame_id},
                           {"count", diagnostic.count},
                           {"text", diagnostic.text},
                           {"advice", diagnostic.advice}});
  }
  return {{"sequence", summary.sequence},
          {"frames",
           {{"sent", summary.frames_sent},
            {"accepted", summary.frames_accepted},
            {"rejected", summary.frames_rejected},
            {"dropped", summary.frames_dropped},
            {"with_pose", summary.frames_with_pose},
            {"skipped", summary.skipped_frames},
            {"keyframes", summary.keyframes}}},
          {"masks",
           {{"sent_with_frames", summary.frames_with_masks},
            {"sent_late", summary.late_masks.sent},
            {"late_rejected", summary.late_masks.rejected}}},
          {"tracking",
           {{"initializing", summary.tracking.initializing},
            {"tracked", summary.tracking.tracked},
            {"lost", summary.tracking.lost},
            {"relocalized", summary.tracking.relocalized},
            {"rotation_only", summary.tracking.rotation_only}}},
          {"map_points", summary.map_points},
          {"mapping_s", summary.mapping_s},
          {"training_after_last_frame_s", summary.training_s},
          {"frames_per_s", summary.frames_per_s},
          {"median_latency_ms", summary.median_latency_ms},
          {"interrupted", summary.interrupted},
          {"training_complete", summary.training_complete},
          {"server_peak_bytes", summary.server_peak_bytes},
          {"client_peak_bytes", summary.client_peak_bytes},
          {"objects", objects},
          {"diagnostics", diagnostics},
          {"faults", summary.faults}};
}

std::string FormatSummary(const RunSummary& summary) {
  std::string text = fmt::format(
      "{} frames ({} keyframes, {} rejected, {} dropped) in {:.1f} s: {:.1f} frames/s; training took {:.1f} s after "
      "the last frame{}\n",
      summary.frames_accepted, summary.keyframes, summary.frames_rejected, summary.frames_dropped, summary.mapping_s,
      summary.frames_per_s, summary.training_s,
      summary.interrupted         ? " (interrupted: partial map)"
      : summary.training_complete ? ""
                                  : " (not finished)");
  text += fmt::format("poses: {} of {} frames have one\n", summary.frames_with_pose, summary.frames_sent);
  const MapCollector::Tracking& tracking = summary.tracking;
  if (tracking.initializing + tracking.lost > 0) {
    text += fmt::format("camera: {} frames to initialize, {} tracked, {} lost, {} relocalizations",
                        tracking.initializing, tracking.tracked, tracking.lost, tracking.relocalized);
    if (tracking.rotation_only > 0) text += fmt::format(" (rotation alone: {})", tracking.rotation_only);
    text += tracking.tracked == 0 ? fmt::format("; never tracked: {}\n", tracking.last_reason) : "\n";
  }
  if (summary.frames_with_masks < summary.frames_sent) {
    text += fmt::format("masks: {} sent with their frames, {} sent late ({} of these rejected)\n",
                        summary.frames_with_masks, summary.late_masks.sent, summary.late_masks.rejected);
  }
  text += fmt::format("peak memory: mapping {} MiB, client {} MiB\n", summary.server_peak_bytes >> 20,
                      summary.client_peak_bytes >> 20);
  text += FormatObjects(summary.objects) + FormatNextView(summary.objects);
  text += FormatFinalDiagnostics(summary.diagnostics, summary.said);
  for (const std::string& fault : summary.faults) text += "error: " + fault + "\n";
  return text;
}

}  // namespace romap::cli
