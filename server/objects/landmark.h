#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/cuboid.h"
#include "common/map_events.h"
#include "server/objects/object_shape.h"
#include "server/objects/point_registry.h"
#include "server/objects/view_picker.h"

namespace romap::objects {

// An object of the map, or what may become one.
struct Landmark {
  Landmark(LandmarkKey new_key, const ObjectsConfig& config) : key(new_key), shape(config), views(config) {}

  LandmarkKey key;
  ObjectId id;  // given when it is confirmed
  ObjectState state = ObjectState::kProvisional;

  // Sightings.
  uint64_t last_frame = 0;  // counted by the mapper, not the client's frame ids
  uint64_t sightings = 0;
  int keyframe_sightings = 0;
  uint64_t expected = 0;     // frames in which it was seen or ought to have been
  int missed_in_view = 0;    // frames without a sighting since the last one, though nothing hid it
  double agreement_sum = 0;  // of the sightings' masks with its shape (Match::agreement)
  uint64_t agreement_count = 0;
  cv::Rect last_box_px;
  SE3<World, Camera> last_T_world_camera;
  std::optional<uint64_t> last_track_id;
  std::map<std::string, double> class_evidence;  // sum of detection scores
  // What tells two things from one thing twice: frames in which both had a mask, and frames in which this one had none
  // and that one's mask lay over its body.
  std::map<LandmarkKey, uint64_t> seen_beside;
  std::map<LandmarkKey, uint64_t> covered_by;
  std::vector<KeyframeId> keyframes;  // in which it was seen for certain

  // Geometry, always as of the newest correction of the map.
  ObjectShape shape;
  bool needs_fit = false;                   // silhouettes came since the last fit
  uint64_t last_fit_frame = 0;              // counted as `last_frame`
  std::optional<Cuboid> cuboid;             // newest fit
  std::optional<Cuboid> reach;              // the same, see CuboidFit: what its field learns in
  double parallax_rad = 0;                  // of the silhouettes behind it
  std::vector<Eigen::Vector3d> body_world;  // points spread over its volume; its map points while there is no cuboid
  std::vector<MapPointId> points;           // its map points without outliers

  ViewPicker views;
  std::optional<ObjectUpdate> published;
  bool has_field = false;  // ObjectViews were sent
  // What corrections did to its space since clients and its field were last told; nullopt: nothing. They know no more
  // than `published` and the views sent, so what is not worth telling by itself adds up here.
  std::optional<Sim3<World, World>> S_now_told;

  // Clients and its field may count on it (until it is merged into another one).
  bool IsConfirmed() const { return published && state != ObjectState::kProvisional; }

  // The class with most evidence and its share; ties go to the alphabet.
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

}  // namespace romap::objects
