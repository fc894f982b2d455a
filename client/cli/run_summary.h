#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "client/cli/map_collector.h"
#include "client/cli/map_files.h"
#include "client/cli/run_stream.h"
#include "client/files/sequence.h"

namespace romap::cli {

// What one run came to: the figures behind summary.json and the table at its end.
struct RunSummary {
  struct Object {
    std::string name;  // the stem of its files
    std::string class_name;
    Eigen::Vector3d center_world = Eigen::Vector3d::Zero();  // map units
    Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units
    uint64_t observations = 0;
    uint64_t steps = 0;
    double train_s = 0;
    size_t vertices = 0, triangles = 0;
    double first_cuboid_s = -1;  // from the sending of the frame in which it could first be tracked; -1 = unknown
    double first_mesh_s = -1;
  };

  std::string sequence;
  size_t frames_sent = 0, frames_accepted = 0, frames_rejected = 0, keyframes = 0;
  uint64_t frames_dropped = 0, map_points = 0;
  MapCollector::Tracking tracking;
  size_t frames_with_masks = 0;  // sent with them
  MapCollector::LateMasks late_masks;
  double mapping_s = 0, training_s = 0, frames_per_s = 0;
  double median_latency_ms = 0;
  bool interrupted = false, training_complete = false;
  uint64_t server_peak_bytes = 0, client_peak_bytes = 0;
  std::vector<Object> objects;
  std::vector<std::string> faults;
};

RunSummary Summarise(const files::Sequence& sequence, const StreamResult& stream, const MapCollector& collector,
                     const std::vector<MapObject>& objects);
nlohmann::json ToJson(const RunSummary& summary);
// The closing lines for a person.
std::string FormatSummary(const RunSummary& summary);

}  // namespace romap::cli
