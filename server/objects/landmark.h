#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/stage_messages.h"
#include "server/objects/object_shape.h"
#include "server/objects/point_registry.h"

namespace romap::objects {

// Evidence of the detections for one landmark. Frames are counted by the mapper; client frame ids may have gaps.
struct LandmarkEvidence {
  uint64_t first_frame_id = 0;    // the client's, of the first observation
  uint64_t last_frame = 0;        // index of the frame of the last observation
  uint64_t dormant_frames = 0;    // frames since then during which its map was not the current one
  uint64_t observations = 0;      // frames with a mask of it
  int keyframe_observations = 0;  // keyframes with an unambiguous mask of it
  int whole_observations = 0;     // of these: the border of the image does not cut it off
  uint64_t expected = 0;          // frames with a mask of it, and frames that should have shown it
  int missed_in_view = 0;         // frames since the last observation that should have shown it
  double agreement_sum = 0;       // of Match::agreement, over `agreement_count` observations
  uint64_t agreement_count = 0;
  std::map<std::string, double> class_evidence;  // sum of detection scores by class
  // These counts distinguish two objects from one object that has two landmarks: frames in which both landmarks had a
  // mask, and frames in which this one had none and the mask of the other one covered it.
  std::map<LandmarkKey, uint64_t> observed_with;
  std::map<LandmarkKey, uint64_t> covered_by;

  // The class with the most evidence and its share, 0..1. Among equal classes, the first in alphabetical order.
  std::pair<std::string, double> BestClass() const {
    std::pair<std::string, double> best{"object", 0};
    double total = 0;
    for (const auto& [name, evidence] : class_evidence) {
      total += evidence;
      if (evidence > best.second) best = {name, evidence};
    }
    if (total > 0) best.second /= total;
    return best;
  }
};

// Geometry of a landmark, in the world of its map after the newest correction.
struct LandmarkGeometry {
  std::optional<Cuboid> cuboid;             // newest fit
  std::optional<Cuboid> training_box;       // of the same fit, see CuboidFit
  double parallax_rad = 0;                  // between the silhouettes of the fit
  std::vector<Eigen::Vector3d> body_world;  // points spread over its volume; its map points while there is no cuboid
  std::vector<MapPointId> points;           // its map points without outliers, ascending
};

// An object of the map, or a hypothesis that there is one.
struct Landmark {
  Landmark(LandmarkKey new_key, const ObjectsConfig& config) : key(new_key), shape(config) {}

  LandmarkKey key;
  SparseMapId map = {};  // the map that it belongs to
  ObjectState state = ObjectState::kProvisional;
  LandmarkEvidence evidence;
  LandmarkGeometry geometry;

  // The last observation, used to predict the next one.
  cv::Rect last_box_px;
  SE3<World, Camera> last_T_world_camera;
  std::optional<uint64_t> last_track_id;

  std::vector<KeyframeId> keyframes;  // with an unambiguous mask of it
  ObjectShape shape;
  bool needs_fit = false;       // the silhouettes changed since the last fit
  uint64_t last_fit_frame = 0;  // index of the frame of the last fit
};

}  // namespace romap::objects
