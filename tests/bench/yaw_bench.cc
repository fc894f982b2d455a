// Compares the yaw from line segments with a sequence's objects.yaml, using the poses and masks of the sequence.
//
//   yaw_bench DIR...
//
// Selects the silhouettes of each object like the object mapper (from keyframes at least 3 degrees apart, at most 36)
// and prints the yaw error modulo a quarter turn, the confidence, and the time: with all views, with `up` tilted by 2
// degrees about x and about y, and for consecutive groups of a few views; and the yaw error of the principal axis of
// the object's map points.

#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/files/sequence.h"
#include "common/angles.h"
#include "common/config.h"
#include "server/objects/detections.h"
#include "server/objects/lines/line_segments.h"
#include "server/objects/lines/yaw_from_lines.h"
#include "server/objects/pca_yaw.h"
#include "server/session/ingest.h"
#include "server/slam/sparse_mapper.h"
#include "server/slam/tracker.h"
#include "tests/bench/user_seconds.h"

namespace romap::measure {
namespace {

// The observations of one object.
struct ObservedObject {
  std::vector<Eigen::Matrix3d> R_world_camera;
  std::vector<std::vector<objects::LineSegment>> segments;
  std::vector<Eigen::Vector3d> directions;
  std::map<MapPointId, int> points;  // number of keyframes with the point on its mask
};

struct Run {
  std::map<int64_t, ObservedObject> objects;  // by label
  std::map<MapPointId, Eigen::Vector3d> points;
  double find_s = 0;
  int crops = 0;
  double crop_area_px2 = 0;
};

void ObserveKeyframe(const KeyframeView& view, const objects::ObjectsConfig& config, Run& run) {
  const Frame& frame = *view.frame;
  for (const MapPoint& point : view.points) run.points[point.id] = point.position_world;
  for (const PointObservation& observation : view.observations) {
    if (observation.label != 0) ++run.objects[observation.label].points[observation.point];
  }
  for (const objects::Detection& detection : objects::ExtractDetections(frame, config)) {
    ObservedObject& observed = run.objects[detection.label];
    const cv::Rect& box_px = detection.box_px;
    const Eigen::Vector3d direction =
        view.T_world_camera.rotation() *
        frame.camera.Unproject(box_px.x + (box_px.width - 1) / 2.0, box_px.y + (box_px.height - 1) / 2.0);
    const bool redundant = std::any_of(observed.directions.begin(), observed.directions.end(), [&](const auto& other) {
      return AngleBetween(other, direction) < config.silhouette_angle_deg * kRadPerDeg;
    });
    if (redundant || observed.directions.size() >= static_cast<size_t>(config.max_silhouettes)) continue;
    const double start_s = UserSeconds();
    observed.segments.push_back(
        objects::FindLineSegments(frame.image_bgr, frame.labels, detection.label, detection.box_px));
    run.find_s += UserSeconds() - start_s;
    observed.directions.push_back(direction);
    observed.R_world_camera.push_back(view.T_world_camera.RotationMatrix());
    run.crop_area_px2 += detection.box_px.area();
    ++run.crops;
  }
}

absl::StatusOr<Run> ObserveSequence(const files::Sequence& sequence) {
  const slam::SlamConfig slam;
  const objects::ObjectsConfig objects;
  slam::LocalMapSlot local_map;
  slam::Tracker tracker(slam, PoseUse::kGiven, &local_map);
  slam::SparseMapper sparse(slam, &local_map, slam::SparseMapper::Background::kNothing);
  session::Ingest ingest(sequence.camera(), /*max_mask_delay_s=*/0);
  Run run;
  for (size_t i = 0; i < sequence.size(); ++i) {
    ROMAP_ASSIGN_OR_RETURN(const FrameInput input, sequence.Load(i));
    ROMAP_ASSIGN_OR_RETURN(const std::shared_ptr<const Frame> frame, ingest.Accept(input));
    const slam::MappedFrame mapped = sparse.Process(tracker.Track(frame));
    if (mapped.view) ObserveKeyframe(*mapped.view, objects, run);
  }
  return run;
}

void PrintYaw(const char* name, const Eigen::Matrix3d& R_world_reference, std::span<const objects::LineView> views) {
  const double start_s = UserSeconds();
  const auto yaw = objects::YawFromLines(R_world_reference, views);
  const double time_ms = 1e3 * (UserSeconds() - start_s);
  if (!yaw) {
    std::printf(" %s none", name);
    return;
  }
  std::printf(" %s %5.1f deg (%.2f) %d edges %.2f ms", name, yaw->yaw_rad / kRadPerDeg, yaw->confidence, yaw->edges,
              time_ms);
}

void PrintGroups(const Eigen::Matrix3d& R_world_reference, std::span<const objects::LineView> views) {
  for (const size_t count : {1, 3, 6, 12}) {
    std::printf("    groups of %2zu:", count);
    for (size_t first = 0; first + count <= views.size(); first += count) {
      const auto yaw = objects::YawFromLines(R_world_reference, views.subspan(first, count));
      if (yaw) std::printf(" %.0f(%.2f)", yaw->yaw_rad / kRadPerDeg, yaw->confidence);
    }
    std::printf("\n");
  }
}

void PrintObject(const files::Sequence& sequence, const Run& run, const files::ObjectRecord& truth) {
  const auto found = run.objects.find(truth.id);
  if (found == run.objects.end()) return;
  const ObservedObject& observed = found->second;
  std::vector<objects::LineView> views;
  for (size_t i = 0; i < observed.segments.size(); ++i) {
    views.push_back({sequence.camera(), observed.R_world_camera[i], observed.segments[i]});
  }
  const Eigen::Matrix3d R_true = truth.T_world_object.RotationMatrix();
  std::printf("%-10s %2zu views", truth.name.c_str(), views.size());
  PrintYaw("|", R_true, views);
  const double tilt_rad = 2 * kRadPerDeg;
  PrintYaw("| tilted", Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d::UnitX()) * R_true, views);
  PrintYaw("|", Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d::UnitY()) * R_true, views);
  std::vector<Eigen::Vector3d> points;
  for (const auto& [id, count] : observed.points) {
    const auto position = run.points.find(id);
    if (count >= 2 && position != run.points.end()) points.push_back(truth.T_world_object.Inverse() * position->second);
  }
  const auto pca_rad = objects::PcaYaw(points);
  std::printf(" | PCA of %zu points", points.size());
  if (pca_rad) std::printf(" %5.1f deg", std::remainder(*pca_rad / kRadPerDeg, 90));
  std::printf("\n");
  PrintGroups(R_true, views);
}

int Main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const auto sequence = files::Sequence::Open(argv[i]);
    if (!sequence.ok() || !sequence->objects()) {
      std::fprintf(stderr, "%s: %s\n", argv[i],
                   sequence.ok() ? "objects.yaml does not exist" : Message(sequence.status()).c_str());
      return 2;
    }
    const auto run = ObserveSequence(*sequence);
    if (!run.ok()) {
      std::fprintf(stderr, "%s\n", Message(run.status()).c_str());
      return 1;
    }
    std::printf("%s: %d crops of %.0f x %.0f px on average, %.3f ms each\n", argv[i], run->crops,
                std::sqrt(run->crop_area_px2 / run->crops), std::sqrt(run->crop_area_px2 / run->crops),
                1e3 * run->find_s / run->crops);
    for (const files::ObjectRecord& truth : sequence->objects()->objects) PrintObject(*sequence, *run, truth);
  }
  return 0;
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) { return romap::measure::Main(argc, argv); }
