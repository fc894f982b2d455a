#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/map_collector.h"
#include "client/cli/map_files.h"
#include "client/cli/run_stream.h"
#include "client/files/sequence.h"

namespace romap::cli {

// The results of one run, for summary.json and the final table.
struct RunSummary {
  struct Object {
    std::string name;  // stem of its file names
    std::string class_name;
    Eigen::Vector3d center_world = Eigen::Vector3d::Zero();  // map units
    Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units
    uint64_t observations = 0;
    uint64_t map_id = 0;  // see ObjectUpdate
    uint64_t steps = 0;
    double train_s = 0;
    size_t vertices = 0, triangles = 0;
    // Delays after sending the first frame in which the object was trackable; -1 = unknown.
    double first_cuboid_s = -1;
    double first_mesh_s = -1;
    // From the object to a camera that would see most of what was observed badly; World frame, unit length. nullopt: no
    // view would add much.
    std::optional<Eigen::Vector3d> next_view_world = {};
    double next_view_gain = 0;  // share of the surface
  };

  std::string sequence;
  size_t frames_sent = 0, frames_accepted = 0, frames_rejected = 0, keyframes = 0;
  uint64_t frames_dropped = 0, map_points = 0;
  MapCollector::Tracking tracking;
  size_t frames_with_masks = 0;          // sent together with their masks
  size_t frames_with_pose = 0;           // sent with a pose of the sequence
  std::vector<uint64_t> skipped_frames;  // ids of the frames that were not sent because their image is unreadable
  MapCollector::LateMasks late_masks;
  double mapping_s = 0, training_s = 0, frames_per_s = 0;
  double median_latency_ms = 0;
  bool interrupted = false, training_complete = false;
  uint64_t server_peak_bytes = 0, client_peak_bytes = 0;
  std::vector<Object> objects;
  std::vector<Diagnostic> diagnostics;  // of the client, then of the server at the end of the session
  std::vector<Diagnostic> said;         // those that were printed during the run, as they were then
  std::vector<std::string> faults;
};

RunSummary Summarize(const files::Sequence& sequence, const StreamResult& stream, const MapCollector& collector,
                     const std::vector<MapObject>& objects);
nlohmann::json ToJson(const RunSummary& summary);
// Formats the summary as text. Diagnostics that were printed during the run are only counted.
std::string FormatSummary(const RunSummary& summary);

}  // namespace romap::cli
