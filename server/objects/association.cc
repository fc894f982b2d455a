#include "server/objects/association.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "server/objects/projection.h"
#include "server/objects/score_assignment.h"

namespace romap::objects {
namespace {

constexpr uint64_t kRecentFrames = 15;  // maximum age of an observation whose box predicts the next one
constexpr double kMinMatchScore = 0.3;  // between a detection and a landmark
constexpr size_t kMinBodyPoints = 4;
constexpr double kMinShareInImage = 0.3;  // of the body points: enough to compare the body with masks
constexpr double kMinBetterFit = 0.1;     // IoU by which two boxes together must fit better than one alone
constexpr double kMostlyCovered = 0.7;    // share of the body under one mask

// Predicts the box of the last observation in the current image, assuming that its corners are at depth `depth_mu`.
cv::Rect PredictBox(const Landmark& landmark, const TrackedFrame& tracked, double depth_mu) {
  const CameraModel& camera = tracked.frame->camera;
  const SE3<Camera, World> T_camera_world = tracked.T_world_camera.Inverse();
  const cv::Rect& box = landmark.last_box_px;
  std::vector<Eigen::Vector3d> corners;
  for (int corner = 0; corner < 4; ++corner) {
    const double u_px = box.x + (corner % 2 == 0 ? 0 : box.width - 1);
    const double v_px = box.y + (corner / 2 == 0 ? 0 : box.height - 1);
    const Eigen::Vector3d ray = camera.Unproject(u_px, v_px);
    // Without a depth only the rotation is compensated, which is accurate for distant objects.
    corners.push_back(depth_mu > 0 ? T_camera_world * (landmark.last_T_world_camera * (depth_mu * ray))
                                   : T_camera_world.rotation() * (landmark.last_T_world_camera.rotation() * ray));
  }
  return BoundProjections(corners, camera);
}

// Projection of a landmark's body points. Shares are 0..1.
struct BodyProjection {
  bool known = false;                      // some point is in the image
  std::vector<double> share_in_detection;  // of the points in the image, per detection
  double share_in_image = 0;               // of all points
  double share_masked = 0;                 // of the points in the image: under any mask
};

BodyProjection ProjectBody(const Landmark& landmark, const TrackedFrame& tracked,
                           const std::vector<Detection>& detections) {
  BodyProjection projection{.share_in_detection = std::vector<double>(detections.size(), 0)};
  const std::vector<Eigen::Vector3d>& body_world = landmark.geometry.body_world;
  if (body_world.size() < kMinBodyPoints) return projection;
  const SE3<Camera, World> T_camera_world = tracked.T_world_camera.Inverse();
  const CameraModel& camera = tracked.frame->camera;
  const cv::Mat& labels = tracked.frame->labels;
  int in_image = 0;
  int masked = 0;
  for (const Eigen::Vector3d& p_world : body_world) {
    const auto pixel = ProjectToPixel(T_camera_world * p_world, camera);
    if (!pixel) continue;
    ++in_image;
    if (labels.empty()) continue;
    const uint16_t label = labels.at<uint16_t>(pixel->y, pixel->x);
    if (label == 0) continue;
    ++masked;
    const auto d = std::lower_bound(detections.begin(), detections.end(), label,
                                    [](const Detection& detection, uint16_t l) { return detection.label < l; });
    if (d != detections.end() && d->label == label) {
      projection.share_in_detection[static_cast<size_t>(d - detections.begin())] += 1;
    }
  }
  if (in_image == 0) return projection;
  projection.known = true;
  for (double& share : projection.share_in_detection) share /= in_image;
  projection.share_in_image = static_cast<double>(in_image) / static_cast<double>(body_world.size());
  projection.share_masked = static_cast<double>(masked) / in_image;
  return projection;
}

// Weighted mean of the cues that are available.
class Score {
 public:
  void Add(double weight, double value) {
    sum_ += weight * value;
    weights_ += weight;
  }
  void AddGeometric(double weight, double value) {
    Add(weight, value);
    best_geometric_ = std::max(best_geometric_, value);
  }
  // 0 without geometric overlap: class and track id alone are not sufficient for a match.
  double Value() const {
    constexpr double kMinOverlap = 0.2;
    return weights_ > 0 && best_geometric_ >= kMinOverlap ? sum_ / weights_ : 0;
  }

 private:
  double sum_ = 0;
  double weights_ = 0;
  double best_geometric_ = 0;
};

// Adds the share of the visible body in the mask. Points under other masks may be occluded and count less. Therefore an
// object that reappears from behind another one matches as soon as a part of it is visible, if that part lies in its
// cuboid.
void AddBodyCue(const BodyProjection& body, size_t d, const cv::Rect& projected, const cv::Rect& box, Score* score) {
  constexpr double kWeight = 1.5;
  constexpr double kMostlyOccluded = 0.5;   // share of the body under other masks
  constexpr double kMinWeightFactor = 0.2;  // of a body that is nearly all occluded
  const double in_mask = body.share_in_detection[d];
  const double under_others = body.share_masked - in_mask;
  if (under_others < kMostlyOccluded || in_mask <= 0 || projected.empty()) return score->AddGeometric(kWeight, in_mask);
  const double share_in_cuboid = static_cast<double>((box & projected).area()) / box.area();
  const double weight = kWeight * std::max(kMinWeightFactor, 1 - under_others);
  score->AddGeometric(weight, share_in_cuboid * in_mask / (1 - under_others));
}

// Mean depth of the body in the last observation.
double DepthOf(const Landmark& landmark, double scene_depth_mu) {
  const std::vector<Eigen::Vector3d>& body_world = landmark.geometry.body_world;
  if (body_world.empty()) return scene_depth_mu;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : body_world) mean += p;
  mean /= static_cast<double>(body_world.size());
  return (landmark.last_T_world_camera.Inverse() * mean).z();
}

// A frame and the landmarks in it. Boxes and bodies are per landmark.
struct Scene {
  const TrackedFrame& tracked;
  const std::vector<Detection>& detections;
  const std::vector<std::unique_ptr<Landmark>>& landmarks;
  uint64_t frame_index;
  double scene_depth_mu;
  std::vector<BodyProjection> bodies;
  std::vector<cv::Rect> projected;  // its cuboid; empty = unknown
  std::vector<cv::Rect> predicted;  // the box of its last observation, see PredictBox; empty = too long ago
};

// The scores of landmark `l` with every detection.
void ScoreLandmark(const Scene& scene, size_t l, Eigen::Ref<Eigen::RowVectorXd> scores) {
  constexpr double kCuboidWeight = 0.7;
  constexpr double kClassWeight = 0.25;
  constexpr double kTrackWeight = 0.1;
  // A part that the detector split off an object must not be matched to the object's mask later.
  constexpr double kProvisionalFactor = 0.8;
  const Landmark& landmark = *scene.landmarks[l];
  const LandmarkEvidence& known = landmark.evidence;
  const BodyProjection& body = scene.bodies[l];
  const uint64_t gap = scene.frame_index - known.last_frame;
  const bool recent = gap <= kRecentFrames;
  const cv::Rect& predicted = scene.predicted[l];
  const double factor = landmark.state == ObjectState::kProvisional ? kProvisionalFactor : 1;
  double total_evidence = 0;
  for (const auto& [name, evidence] : known.class_evidence) total_evidence += evidence;
  for (size_t d = 0; d < scene.detections.size(); ++d) {
    const Detection& detection = scene.detections[d];
    Score score;
    if (recent) {
      score.AddGeometric(1.0 - static_cast<double>(gap) / (kRecentFrames + 1), BoxIou(predicted, detection.box_px));
    }
    if (body.share_in_image > kMinShareInImage) AddBodyCue(body, d, scene.projected[l], detection.box_px, &score);
    if (scene.projected[l].area() > 0) {
      score.AddGeometric(kCuboidWeight, BoxIou(scene.projected[l], detection.box_px));
    }
    const auto evidence = known.class_evidence.find(detection.class_name);
    const bool known_class = evidence != known.class_evidence.end() && total_evidence > 0;
    score.Add(kClassWeight, known_class ? evidence->second / total_evidence : 0);
    if (recent && landmark.last_track_id && detection.track_id) {
      score.Add(kTrackWeight, *landmark.last_track_id == *detection.track_id ? 1 : 0);
    }
    scores[static_cast<Eigen::Index>(d)] = factor * score.Value();
    if (score.Value() > 0 && spdlog::should_log(spdlog::level::debug)) {
      spdlog::debug(
          "objects: frame {}: label {} scores {:.2f} with landmark {} (body {:.2f}, cuboid {:.2f}, last box {:.2f})",
          scene.tracked.frame->frame_id, detection.label, score.Value(), landmark.key, body.share_in_detection[d],
          BoxIou(scene.projected[l], detection.box_px), BoxIou(predicted, detection.box_px));
    }
  }
}

// Whether another pair with the landmark or the detection scores almost as well. Landmarks that were never observed
// together are not rivals: they may be duplicates of one object, and would permanently block each other's updates.
bool IsAmbiguous(const Scene& scene, const Eigen::MatrixXd& scores, Eigen::Index landmark, Eigen::Index detection) {
  constexpr double kMargin = 0.1;
  const auto& observed_with = scene.landmarks[static_cast<size_t>(landmark)]->evidence.observed_with;
  const double rival_score = scores(landmark, detection) - kMargin;
  for (Eigen::Index d = 0; d < scores.cols(); ++d) {
    if (d != detection && scores(landmark, d) > rival_score) return true;
  }
  for (Eigen::Index l = 0; l < scores.rows(); ++l) {
    const bool are_two_objects = observed_with.contains(scene.landmarks[static_cast<size_t>(l)]->key);
    if (l != landmark && are_two_objects && scores(l, detection) > rival_score) return true;
  }
  return false;
}

// Whether the mask of detection `d`, matched to landmark `l`, also covers another object: that object has no separate
// mask, its body projects into mask `d`, and the mask fits both objects together better than `l` alone. (An object
// behind `l` also projects into its mask, but does not make the mask larger.)
bool CoversAnother(const Scene& scene, size_t d, size_t l, const std::vector<bool>& matched) {
  const cv::Rect& box = scene.detections[d].box_px;
  if (scene.projected[l].empty()) return false;
  const double alone = BoxIou(box, scene.projected[l]);
  for (size_t other = 0; other < scene.landmarks.size(); ++other) {
    if (other == l || matched[other] || scene.projected[other].empty()) continue;
    if (scene.landmarks[other]->state == ObjectState::kProvisional) continue;
    const BodyProjection& body = scene.bodies[other];
    if (body.share_in_image < kMinShareInImage || body.share_in_detection[d] < kMostlyCovered) continue;
    if (BoxIou(box, scene.projected[l] | scene.projected[other]) > alone + kMinBetterFit) return true;
  }
  return false;
}

// Whether the unmatched detection `part` was split off landmark `l`: it lies in the landmark's cuboid, and the
// landmark's mask `d` together with it fits the cuboid better than `d` alone.
bool IsPartOf(const Scene& scene, size_t part, size_t d, size_t l) {
  constexpr double kMinShareInCuboid = 0.8;  // of the area of the detection's box
  if (scene.projected[l].empty() || scene.landmarks[l]->state == ObjectState::kProvisional) return false;
  const cv::Rect& box = scene.detections[part].box_px;
  if ((box & scene.projected[l]).area() < kMinShareInCuboid * box.area()) return false;
  const cv::Rect& main_box = scene.detections[d].box_px;
  return BoxIou(main_box | box, scene.projected[l]) > BoxIou(main_box, scene.projected[l]) + kMinBetterFit;
}

// Adds doubts to unmatched detections that are part of a landmark, and to the match of that landmark.
void MarkParts(const Scene& scene, std::vector<Match>* matches) {
  for (size_t part = 0; part < matches->size(); ++part) {
    if ((*matches)[part].landmark >= 0) continue;
    for (size_t d = 0; d < matches->size(); ++d) {
      const int l = (*matches)[d].landmark;
      if (l < 0 || !IsPartOf(scene, part, d, static_cast<size_t>(l))) continue;
      (*matches)[part].doubt = "part of another object";
      (*matches)[d].doubt = "part of the object is missing";
      spdlog::debug("objects: frame {}: label {} is part of landmark {}", scene.tracked.frame->frame_id,
                    scene.detections[part].label, scene.landmarks[static_cast<size_t>(l)]->key);
      break;
    }
  }
}

// Mean of the share of the body in the mask and of the overlap of the mask's box with the cuboid's. nullopt if the
// landmark is cut off by the border of the image or by other masks.
std::optional<double> Agreement(const Scene& scene, size_t d, size_t l) {
  constexpr double kMinWhole = 0.95;          // share of the body in the image and not under other masks
  constexpr double kMaxOtherPerInMask = 0.1;  // body points under other masks, per point in this one: masks touch
  const BodyProjection& body = scene.bodies[l];
  if (!body.known || scene.projected[l].empty() || body.share_in_image < kMinWhole) return std::nullopt;
  const double in_mask = body.share_in_detection[d];
  const double under_others = body.share_masked - in_mask;
  if (under_others > 1 - kMinWhole && under_others > kMaxOtherPerInMask * in_mask) return std::nullopt;
  return 0.5 * (in_mask + BoxIou(scene.projected[l], scene.detections[d].box_px));
}

// The landmark whose mask covers landmark `l`, see Association::covered_by.
int CoveringLandmark(const Scene& scene, size_t l, const std::vector<Match>& matches) {
  constexpr double kMinBodyInImage = 0.6;  // share of the body
  const BodyProjection& body = scene.bodies[l];
  const cv::Rect& predicted = scene.predicted[l];
  const auto covered_share = [&](size_t d) -> double {
    if (body.known) return body.share_in_image < kMinBodyInImage ? 0 : body.share_in_detection[d];
    // The predicted box represents a landmark without a body.
    if (predicted.empty()) return 0;
    return static_cast<double>((predicted & scene.detections[d].box_px).area()) / predicted.area();
  };
  for (size_t d = 0; d < matches.size(); ++d) {
    if (matches[d].doubt == nullptr && covered_share(d) >= kMostlyCovered) return matches[d].landmark;
  }
  return -1;
}

// Implements the first stage of the paper: matches boxes greedily to those of the previous frame, best overlap first. A
// detection without a match becomes a new landmark, which is merged later if its points belong to an old one.
std::vector<Match> MatchGreedily(const Scene& scene) {
  constexpr double kMinIou = 0.3;
  struct Pair {
    double iou;
    size_t landmark, detection;
  };
  std::vector<Pair> pairs;
  for (size_t l = 0; l < scene.landmarks.size(); ++l) {
    if (scene.frame_index - scene.landmarks[l]->evidence.last_frame != 1) continue;
    for (size_t d = 0; d < scene.detections.size(); ++d) {
      const double iou = BoxIou(scene.landmarks[l]->last_box_px, scene.detections[d].box_px);
      if (iou >= kMinIou) pairs.push_back({iou, l, d});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.iou > b.iou; });
  std::vector<Match> matches(scene.detections.size());
  std::vector<bool> taken(scene.landmarks.size(), false);
  for (const Pair& pair : pairs) {
    if (taken[pair.landmark] || matches[pair.detection].landmark >= 0) continue;
    taken[pair.landmark] = true;
    matches[pair.detection].landmark = static_cast<int>(pair.landmark);
  }
  return matches;
}

std::vector<Match> MatchGlobally(const Scene& scene) {
  const auto rows = static_cast<Eigen::Index>(scene.landmarks.size());
  const auto columns = static_cast<Eigen::Index>(scene.detections.size());
  Eigen::MatrixXd scores = Eigen::MatrixXd::Zero(rows, columns);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(columns);
  for (size_t l = 0; l < scene.landmarks.size(); ++l) {
    ScoreLandmark(scene, l, row);
    scores.row(static_cast<Eigen::Index>(l)) = row;
  }
  const std::vector<int> detection_of = AssignByScore(scores, kMinMatchScore);
  std::vector<bool> matched(scene.landmarks.size(), false);
  for (size_t l = 0; l < matched.size(); ++l) matched[l] = detection_of[l] >= 0;
  std::vector<Match> matches(scene.detections.size());
  for (size_t l = 0; l < matched.size(); ++l) {
    if (!matched[l]) continue;
    const auto d = static_cast<size_t>(detection_of[l]);
    Match& match = matches[d];
    match.landmark = static_cast<int>(l);
    match.agreement = Agreement(scene, d, l);
    if (CoversAnother(scene, d, l, matched)) {
      match.doubt = "mask covers a second object";
    } else if (IsAmbiguous(scene, scores, static_cast<Eigen::Index>(l), detection_of[l])) {
      match.doubt = "another match scores nearly as well";
    }
    spdlog::debug("objects: frame {}: label {} ({}) matched to landmark {}, score {:.2f}{}{}",
                  scene.tracked.frame->frame_id, scene.detections[d].label, scene.detections[d].class_name,
                  scene.landmarks[l]->key, scores(static_cast<Eigen::Index>(l), detection_of[l]),
                  match.doubt ? ", doubt: " : "", match.doubt ? match.doubt : "");
  }
  MarkParts(scene, &matches);
  return matches;
}

}  // namespace

Association Associate(const TrackedFrame& tracked, const std::vector<Detection>& detections,
                      const std::vector<std::unique_ptr<Landmark>>& landmarks, uint64_t frame_index,
                      double scene_depth_mu, const ObjectsConfig& config) {
  Scene scene{.tracked = tracked,
              .detections = detections,
              .landmarks = landmarks,
              .frame_index = frame_index,
              .scene_depth_mu = scene_depth_mu,
              .bodies = {},
              .projected = {},
              .predicted = {}};
  Association association;
  for (const auto& landmark : landmarks) {
    const BodyProjection& body = scene.bodies.emplace_back(ProjectBody(*landmark, tracked, detections));
    const auto& cuboid = landmark->geometry.cuboid;
    scene.projected.push_back(cuboid ? ProjectCuboid(*cuboid, 1, tracked.frame->camera, tracked.T_world_camera)
                                     : cv::Rect());
    const bool recent = frame_index - landmark->evidence.last_frame <= kRecentFrames;
    scene.predicted.push_back(recent ? PredictBox(*landmark, tracked, DepthOf(*landmark, scene_depth_mu)) : cv::Rect());
    association.visible_share.push_back(body.share_in_image * (1 - body.share_masked));
  }
  const bool greedy = config.association == "greedy_iou";
  association.matches = greedy ? MatchGreedily(scene) : MatchGlobally(scene);
  std::vector<bool> matched(landmarks.size(), false);
  for (const Match& match : association.matches) {
    if (match.landmark >= 0) matched[static_cast<size_t>(match.landmark)] = true;
  }
  for (size_t l = 0; l < landmarks.size(); ++l) {
    association.covered_by.push_back(matched[l] ? -1 : CoveringLandmark(scene, l, association.matches));
  }
  return association;
}

}  // namespace romap::objects
