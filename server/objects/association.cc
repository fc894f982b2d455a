#include "server/objects/association.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "server/objects/assignment.h"
#include "server/objects/projection.h"

namespace romap::objects {
namespace {

constexpr uint64_t kRecentFrames = 15;
constexpr double kMinMatchScore = 0.3;  // between a detection and a landmark
constexpr size_t kFewestBodyPoints = 4;

double BoxIou(const cv::Rect& a, const cv::Rect& b) {
  const double both = (a & b).area();
  const double either = a.area() + b.area() - both;
  return either > 0 ? both / either : 0;
}

// The box of the last sighting as the present camera would see it, had it the given depth in the last one.
cv::Rect CarryBox(const Landmark& landmark, const TrackedFrame& tracked, double depth_mu) {
  const CameraModel& camera = tracked.frame->camera;
  const SE3<Camera, World> T_camera_world = tracked.T_world_camera.Inverse();
  const cv::Rect& box = landmark.last_box_px;
  std::vector<Eigen::Vector3d> corners;
  for (int corner = 0; corner < 4; ++corner) {
    const double u_px = box.x + (corner % 2 == 0 ? 0 : box.width - 1);
    const double v_px = box.y + (corner / 2 == 0 ? 0 : box.height - 1);
    const Eigen::Vector3d ray = camera.Unproject(u_px, v_px);
    // Without any depth only the rotation is undone: right for things far away.
    corners.push_back(depth_mu > 0 ? T_camera_world * (landmark.last_T_world_camera * (depth_mu * ray))
                                   : T_camera_world.rotation() * (landmark.last_T_world_camera.rotation() * ray));
  }
  return BoundProjections(corners, camera);
}

// Where a landmark's body falls in the frame.
struct BodySight {
  bool known = false;
  std::vector<double> share_in_detection;  // of the points in the image
  double share_in_image = 0;
  double share_hidden = 0;  // of the points in the image: under any mask
};

BodySight ProjectBody(const Landmark& landmark, const TrackedFrame& tracked, const std::vector<Detection>& detections) {
  BodySight sight{.share_in_detection = std::vector<double>(detections.size(), 0)};
  if (landmark.body_world.size() < kFewestBodyPoints) return sight;
  const SE3<Camera, World> T_camera_world = tracked.T_world_camera.Inverse();
  const CameraModel& camera = tracked.frame->camera;
  const cv::Mat& labels = tracked.frame->labels;
  int in_image = 0;
  int hidden = 0;
  for (const Eigen::Vector3d& p_world : landmark.body_world) {
    const auto pixel = ProjectToPixel(T_camera_world * p_world, camera);
    if (!pixel) continue;
    ++in_image;
    if (labels.empty()) continue;
    const uint16_t label = labels.at<uint16_t>(pixel->y, pixel->x);
    if (label == 0) continue;
    ++hidden;
    const auto d = std::lower_bound(detections.begin(), detections.end(), label,
                                    [](const Detection& detection, uint16_t l) { return detection.label < l; });
    if (d != detections.end() && d->label == label) {
      sight.share_in_detection[static_cast<size_t>(d - detections.begin())] += 1;
    }
  }
  if (in_image == 0) return sight;
  sight.known = true;
  for (double& share : sight.share_in_detection) share /= in_image;
  sight.share_in_image = static_cast<double>(in_image) / static_cast<double>(landmark.body_world.size());
  sight.share_hidden = static_cast<double>(hidden) / in_image;
  return sight;
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
  // Class and track alone never make a match.
  double Value() const {
    constexpr double kLeastOverlap = 0.2;
    return weights_ > 0 && best_geometric_ >= kLeastOverlap ? sum_ / weights_ : 0;
  }

 private:
  double sum_ = 0;
  double weights_ = 0;
  double best_geometric_ = 0;
};

// Share of the visible body in the mask. What lies under other masks may be hidden and says little: so a thing that
// comes out from behind another one is known by the first of it that shows, if that lies where the thing is.
void AddBodyCue(const BodySight& sight, size_t d, const cv::Rect& projected, const cv::Rect& box, Score* score) {
  constexpr double kWeight = 1.5;
  constexpr double kMostlyHidden = 0.5;
  constexpr double kLeastWeightShare = 0.2;
  const double in_mask = sight.share_in_detection[d];
  const double under_others = sight.share_hidden - in_mask;
  if (under_others < kMostlyHidden || in_mask <= 0 || projected.empty()) return score->AddGeometric(kWeight, in_mask);
  const double lies_there = static_cast<double>((box & projected).area()) / box.area();
  const double weight = kWeight * std::max(kLeastWeightShare, 1 - under_others);
  score->AddGeometric(weight, lies_there * in_mask / (1 - under_others));
}

double DepthOf(const Landmark& landmark, double scene_depth_mu) {
  if (landmark.body_world.empty()) return scene_depth_mu;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : landmark.body_world) mean += p;
  mean /= static_cast<double>(landmark.body_world.size());
  return (landmark.last_T_world_camera.Inverse() * mean).z();
}

constexpr double kInImage = 0.3;  // of the body: enough to compare it with masks

// Everything that is compared in one frame.
struct Scene {
  const TrackedFrame& tracked;
  const std::vector<Detection>& detections;
  const std::vector<std::unique_ptr<Landmark>>& landmarks;
  uint64_t frame_index;
  double scene_depth_mu;
  std::vector<BodySight> sights;    // per landmark
  std::vector<cv::Rect> projected;  // per landmark: its cuboid; empty = unknown
  std::vector<cv::Rect> carried;    // per landmark: its last sighting; empty = too long ago
};

void ScoreLandmark(const Scene& scene, size_t l, Eigen::Ref<Eigen::RowVectorXd> scores) {
  const Landmark& landmark = *scene.landmarks[l];
  const BodySight& sight = scene.sights[l];
  const uint64_t gap = scene.frame_index - landmark.last_frame;
  const bool recent = gap <= kRecentFrames;
  const cv::Rect& carried = scene.carried[l];
  // A piece that was cut off a thing must not take its mask afterwards.
  constexpr double kUnsure = 0.8;
  const double trust = landmark.state == ObjectState::kProvisional ? kUnsure : 1;
  double total_evidence = 0;
  for (const auto& [name, evidence] : landmark.class_evidence) total_evidence += evidence;
  for (size_t d = 0; d < scene.detections.size(); ++d) {
    const Detection& detection = scene.detections[d];
    Score score;
    if (recent) {
      score.AddGeometric(1.0 - static_cast<double>(gap) / (kRecentFrames + 1), BoxIou(carried, detection.box_px));
    }
    if (sight.share_in_image > kInImage) AddBodyCue(sight, d, scene.projected[l], detection.box_px, &score);
    if (scene.projected[l].area() > 0) score.AddGeometric(0.7, BoxIou(scene.projected[l], detection.box_px));
    const auto evidence = landmark.class_evidence.find(detection.class_name);
    const bool known_class = evidence != landmark.class_evidence.end() && total_evidence > 0;
    score.Add(0.25, known_class ? evidence->second / total_evidence : 0);
    if (recent && landmark.last_track_id && detection.track_id) {
      score.Add(0.1, *landmark.last_track_id == *detection.track_id ? 1 : 0);
    }
    scores[static_cast<Eigen::Index>(d)] = trust * score.Value();
    if (score.Value() > 0 && spdlog::should_log(spdlog::level::debug)) {
      spdlog::debug("objects: frame {}: label {} as landmark {}: {:.2f} (body {:.2f}, box {:.2f}, carried {:.2f})",
                    scene.tracked.frame->frame_id, detection.label, landmark.key, score.Value(),
                    sight.share_in_detection[d], BoxIou(scene.projected[l], detection.box_px),
                    BoxIou(carried, detection.box_px));
    }
  }
}

// Whether another pairing of either partner scores almost as well. Landmarks that were never seen side by side may be
// one thing twice, and would keep each other from learning for ever: they are no rivals.
bool IsAmbiguous(const Scene& scene, const Eigen::MatrixXd& scores, Eigen::Index landmark, Eigen::Index detection) {
  constexpr double kMargin = 0.1;
  const std::map<LandmarkKey, uint64_t>& seen_beside = scene.landmarks[static_cast<size_t>(landmark)]->seen_beside;
  const double rival_score = scores(landmark, detection) - kMargin;
  for (Eigen::Index d = 0; d < scores.cols(); ++d) {
    if (d != detection && scores(landmark, d) > rival_score) return true;
  }
  for (Eigen::Index l = 0; l < scores.rows(); ++l) {
    const bool are_two = seen_beside.contains(scene.landmarks[static_cast<size_t>(l)]->key);
    if (l != landmark && are_two && scores(l, detection) > rival_score) return true;
  }
  return false;
}

// Whether the mask of `d`, matched to landmark `l`, is that of `l` and of another thing in one: the other one has no
// mask, its body lies under this one, and this one fits both together better than `l`. (A thing that stands behind `l`
// lies under its mask as well, but does not make the mask larger.)
bool CoversAnother(const Scene& scene, size_t d, size_t l, const std::vector<bool>& matched) {
  constexpr double kUnderMask = 0.7;
  constexpr double kBetter = 0.1;
  const cv::Rect& box = scene.detections[d].box_px;
  if (scene.projected[l].empty()) return false;
  const double alone = BoxIou(box, scene.projected[l]);
  for (size_t other = 0; other < scene.landmarks.size(); ++other) {
    if (other == l || matched[other] || scene.projected[other].empty()) continue;
    if (scene.landmarks[other]->state == ObjectState::kProvisional) continue;
    const BodySight& sight = scene.sights[other];
    if (sight.share_in_image < kInImage || sight.share_in_detection[d] < kUnderMask) continue;
    if (BoxIou(box, scene.projected[l] | scene.projected[other]) > alone + kBetter) return true;
  }
  return false;
}

// Whether detection `piece`, which is no known landmark, is cut off a known thing: it lies where that one is, whose
// mask `d` is too small without it.
bool IsPieceOf(const Scene& scene, size_t piece, size_t d, size_t l) {
  constexpr double kInside = 0.8;
  constexpr double kBetter = 0.1;
  if (scene.projected[l].empty() || scene.landmarks[l]->state == ObjectState::kProvisional) return false;
  const cv::Rect& box = scene.detections[piece].box_px;
  if ((box & scene.projected[l]).area() < kInside * box.area()) return false;
  const cv::Rect& main_box = scene.detections[d].box_px;
  return BoxIou(main_box | box, scene.projected[l]) > BoxIou(main_box, scene.projected[l]) + kBetter;
}

void DoubtPieces(const Scene& scene, std::vector<Match>* matches) {
  for (size_t piece = 0; piece < matches->size(); ++piece) {
    if ((*matches)[piece].landmark >= 0) continue;
    for (size_t d = 0; d < matches->size(); ++d) {
      const int l = (*matches)[d].landmark;
      if (l < 0 || !IsPieceOf(scene, piece, d, static_cast<size_t>(l))) continue;
      (*matches)[piece].doubt = "it is a piece of another thing";
      (*matches)[d].doubt = "a piece of it is missing";
      spdlog::debug("objects: frame {}: label {} is a piece of landmark {}", scene.tracked.frame->frame_id,
                    scene.detections[piece].label, scene.landmarks[static_cast<size_t>(l)]->key);
      break;
    }
  }
}

// Share of the body in the mask, and overlap of the mask's box with the cuboid's. Where the image or other masks cut
// the landmark nothing is said.
std::optional<double> Agreement(const Scene& scene, size_t d, size_t l) {
  constexpr double kWhole = 0.95;
  const BodySight& sight = scene.sights[l];
  if (!sight.known || scene.projected[l].empty() || sight.share_in_image < kWhole) return std::nullopt;
  const double in_mask = sight.share_in_detection[d];
  const double under_others = sight.share_hidden - in_mask;
  if (under_others > 1 - kWhole && under_others > 0.1 * in_mask) return std::nullopt;
  return 0.5 * (in_mask + BoxIou(scene.projected[l], scene.detections[d].box_px));
}

// The landmark whose mask lies over landmark `l`, see Association::covered_by.
int CoveringLandmark(const Scene& scene, size_t l, const std::vector<Match>& matches) {
  constexpr double kMost = 0.7;
  constexpr double kPlainlyInImage = 0.6;
  const BodySight& sight = scene.sights[l];
  const cv::Rect& carried = scene.carried[l];
  for (size_t d = 0; d < matches.size(); ++d) {
    if (matches[d].doubt != nullptr) continue;
    // What has no body yet is compared by its box.
    const double covered = sight.known ? (sight.share_in_image < kPlainlyInImage ? 0 : sight.share_in_detection[d])
                           : carried.empty()
                               ? 0
                               : static_cast<double>((carried & scene.detections[d].box_px).area()) / carried.area();
    if (covered >= kMost) return matches[d].landmark;
  }
  return -1;
}

// The paper's first stage: the box of the frame before, best overlap first. What it does not find is a new landmark,
// until its points tell that it is an old one.
std::vector<Match> MatchGreedily(const Scene& scene) {
  constexpr double kLeastIou = 0.3;
  struct Pair {
    double iou;
    size_t landmark, detection;
  };
  std::vector<Pair> pairs;
  for (size_t l = 0; l < scene.landmarks.size(); ++l) {
    if (scene.frame_index - scene.landmarks[l]->last_frame != 1) continue;
    for (size_t d = 0; d < scene.detections.size(); ++d) {
      const double iou = BoxIou(scene.landmarks[l]->last_box_px, scene.detections[d].box_px);
      if (iou >= kLeastIou) pairs.push_back({iou, l, d});
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

std::vector<Match> MatchGlobally(const Scene& scene, double min_score) {
  const auto rows = static_cast<Eigen::Index>(scene.landmarks.size());
  const auto columns = static_cast<Eigen::Index>(scene.detections.size());
  Eigen::MatrixXd scores = Eigen::MatrixXd::Zero(rows, columns);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(columns);
  for (size_t l = 0; l < scene.landmarks.size(); ++l) {
    ScoreLandmark(scene, l, row);
    scores.row(static_cast<Eigen::Index>(l)) = row;
  }
  const std::vector<int> detection_of = AssignMaximal(scores, min_score);
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
      match.doubt = "it covers another thing as well";
    } else if (IsAmbiguous(scene, scores, static_cast<Eigen::Index>(l), detection_of[l])) {
      match.doubt = "another match is as good";
    }
    spdlog::debug("objects: frame {}: label {} ({}) is landmark {} with {:.2f}{}{}", scene.tracked.frame->frame_id,
                  scene.detections[d].label, scene.detections[d].class_name, scene.landmarks[l]->key,
                  scores(static_cast<Eigen::Index>(l), detection_of[l]), match.doubt ? ", in doubt: " : "",
                  match.doubt ? match.doubt : "");
  }
  DoubtPieces(scene, &matches);
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
              .sights = {},
              .projected = {},
              .carried = {}};
  Association association;
  for (const auto& landmark : landmarks) {
    const BodySight& sight = scene.sights.emplace_back(ProjectBody(*landmark, tracked, detections));
    scene.projected.push_back(landmark->cuboid
                                  ? ProjectCuboid(*landmark->cuboid, 1, tracked.frame->camera, tracked.T_world_camera)
                                  : cv::Rect());
    const bool recent = frame_index - landmark->last_frame <= kRecentFrames;
    scene.carried.push_back(recent ? CarryBox(*landmark, tracked, DepthOf(*landmark, scene_depth_mu)) : cv::Rect());
    association.visible_share.push_back(sight.share_in_image * (1 - sight.share_hidden));
  }
  const bool greedy = config.association == "greedy_iou";
  association.matches = greedy ? MatchGreedily(scene) : MatchGlobally(scene, kMinMatchScore);
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
