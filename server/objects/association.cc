#include "server/objects/association.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "server/objects/assignment.h"
#include "server/objects/projection.h"

namespace romap {
namespace {

constexpr uint64_t kRecentFrames = 15;
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
    hidden += label != 0 ? 1 : 0;
    for (size_t d = 0; d < detections.size(); ++d) {
      if (detections[d].label == label) sight.share_in_detection[d] += 1;
    }
  }
  if (in_image == 0) return sight;
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

double DepthOf(const Landmark& landmark, double scene_depth_mu) {
  if (landmark.body_world.empty()) return scene_depth_mu;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : landmark.body_world) mean += p;
  mean /= static_cast<double>(landmark.body_world.size());
  return (landmark.last_T_world_camera.Inverse() * mean).z();
}

void ScoreLandmark(const Landmark& landmark, const BodySight& sight, const TrackedFrame& tracked,
                   const std::vector<Detection>& detections, uint64_t frame_index, double scene_depth_mu,
                   Eigen::Ref<Eigen::RowVectorXd> scores) {
  const uint64_t gap = frame_index - landmark.last_frame;
  const bool recent = gap <= kRecentFrames;
  const cv::Rect carried = recent ? CarryBox(landmark, tracked, DepthOf(landmark, scene_depth_mu)) : cv::Rect();
  cv::Rect projected;
  if (landmark.cuboid) projected = ProjectCuboid(*landmark.cuboid, 1, tracked.frame->camera, tracked.T_world_camera);
  double total_evidence = 0;
  for (const auto& [name, evidence] : landmark.class_evidence) total_evidence += evidence;
  for (size_t d = 0; d < detections.size(); ++d) {
    const Detection& detection = detections[d];
    Score score;
    if (recent) {
      score.AddGeometric(1.0 - static_cast<double>(gap) / (kRecentFrames + 1), BoxIou(carried, detection.box_px));
    }
    if (sight.share_in_image > 0.3) score.AddGeometric(1.5, sight.share_in_detection[d]);
    if (projected.area() > 0) score.AddGeometric(0.7, BoxIou(projected, detection.box_px));
    const auto evidence = landmark.class_evidence.find(detection.class_name);
    const bool known_class = evidence != landmark.class_evidence.end() && total_evidence > 0;
    score.Add(0.25, known_class ? evidence->second / total_evidence : 0);
    if (recent && landmark.last_track_id && detection.track_id) {
      score.Add(0.1, *landmark.last_track_id == *detection.track_id ? 1 : 0);
    }
    scores[static_cast<Eigen::Index>(d)] = score.Value();
  }
}

// Whether another pairing of either partner scores almost as well.
bool IsAmbiguous(const Eigen::MatrixXd& scores, Eigen::Index landmark, Eigen::Index detection) {
  constexpr double kMargin = 0.1;
  const double rival_score = scores(landmark, detection) - kMargin;
  for (Eigen::Index d = 0; d < scores.cols(); ++d) {
    if (d != detection && scores(landmark, d) > rival_score) return true;
  }
  for (Eigen::Index l = 0; l < scores.rows(); ++l) {
    if (l != landmark && scores(l, detection) > rival_score) return true;
  }
  return false;
}

}  // namespace

Association Associate(const TrackedFrame& tracked, const std::vector<Detection>& detections,
                      const std::vector<std::unique_ptr<Landmark>>& landmarks, uint64_t frame_index,
                      double scene_depth_mu, const ObjectsConfig& config) {
  Association association;
  association.landmark_of_detection.assign(detections.size(), -1);
  association.ambiguous.assign(detections.size(), false);
  Eigen::MatrixXd scores =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(landmarks.size()), static_cast<Eigen::Index>(detections.size()));
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(static_cast<Eigen::Index>(detections.size()));
  for (size_t l = 0; l < landmarks.size(); ++l) {
    const BodySight sight = ProjectBody(*landmarks[l], tracked, detections);
    association.visible_share.push_back(sight.share_in_image * (1 - sight.share_hidden));
    ScoreLandmark(*landmarks[l], sight, tracked, detections, frame_index, scene_depth_mu, row);
    scores.row(static_cast<Eigen::Index>(l)) = row;
  }
  const std::vector<int> detection_of = AssignMaximal(scores, config.match_min_score);
  for (size_t l = 0; l < landmarks.size(); ++l) {
    if (detection_of[l] < 0) continue;
    const auto d = static_cast<size_t>(detection_of[l]);
    association.landmark_of_detection[d] = static_cast<int>(l);
    association.ambiguous[d] = IsAmbiguous(scores, static_cast<Eigen::Index>(l), detection_of[l]);
    if (association.ambiguous[d]) {
      spdlog::debug("objects: frame {}: label {} is landmark {} with score {:.2f}, but ambiguous",
                    tracked.frame->frame_id, detections[d].label, landmarks[l]->key,
                    scores(static_cast<Eigen::Index>(l), detection_of[l]));
    }
  }
  return association;
}

}  // namespace romap
