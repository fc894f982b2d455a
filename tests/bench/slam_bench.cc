// Runs the sparse map over a recorded sequence and compares its points with the depth images.
//
//   slam_bench DIR [--set slam.FIELD=VALUE]... [--sensor-depth]
//
// Prints keyframes, points, points by the most frequent label of their observations, user time per stage, and, where
// the sequence has depth, the relative depth error of every observation of a point by its final position.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "client/files/sequence.h"
#include "common/config.h"
#include "common/label_png.h"
#include "common/statistics.h"
#include "server/slam/sparse_mapper.h"
#include "server/slam/tracker.h"
#include "tests/bench/user_seconds.h"
#include "tests/support/sparse_mapper_inspector.h"

namespace romap::measure {
namespace {

cv::Mat Decode(const std::string& bytes, int flags) {
  if (bytes.empty()) return {};
  const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  return cv::imdecode(raw, flags);
}

std::shared_ptr<const Frame> DecodeFrame(const FrameInput& input, const CameraModel& camera) {
  auto frame = std::make_shared<Frame>();
  frame->frame_id = input.frame_id;
  frame->timestamp_ns = input.timestamp_ns;
  frame->camera = camera;
  frame->image_bgr = Decode(input.image, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  frame->has_masks = !input.label_png.empty();
  if (frame->has_masks) frame->labels = DecodeLabelPng(input.label_png).value();
  if (!input.depth.empty())
    Decode(input.depth, cv::IMREAD_UNCHANGED).convertTo(frame->depth_mu, CV_32F, input.depth_scale_mu);
  frame->T_world_camera = input.T_world_camera;
  return frame;
}

// An observation of a point in a keyframe, with the true depth at its pixel (0 = unknown).
struct ObservedPoint {
  MapPointId point;
  uint16_t label = 0;
  SE3<Camera, World> T_camera_world;
  float true_depth_mu = 0;
};

struct PointRecord {
  MapPoint point;
  std::map<uint16_t, int> labels;
};

struct Run {
  size_t frames = 0;
  double track_s = 0;
  double map_s = 0;
  double slowest_s = 0;
  std::vector<ObservedPoint> observations;
  std::map<MapPointId, PointRecord> points;
};

void Record(const KeyframeView& view, const cv::Mat& true_depth_mu, Run& run) {
  for (size_t i = 0; i < view.observations.size(); ++i) {
    const PointObservation& observation = view.observations[i];
    PointRecord& record = run.points[observation.point];
    record.point = view.points[i];
    ++record.labels[observation.label];
    ObservedPoint observed{observation.point, observation.label, view.T_world_camera.Inverse()};
    if (!true_depth_mu.empty()) {
      observed.true_depth_mu = true_depth_mu.at<float>(static_cast<int>(std::lround(observation.pixel_px.y())),
                                                       static_cast<int>(std::lround(observation.pixel_px.x())));
    }
    run.observations.push_back(observed);
  }
  for (const MapPointId id : view.removed_points) run.points.erase(id);
}

// Lower quantile; NaN without values.
double QuantileOrNan(const std::vector<double>& values, double share) {
  return values.empty() ? std::nan("") : LowerQuantile(values, share);
}

uint16_t MostFrequentLabel(const PointRecord& record) {
  return std::max_element(record.labels.begin(), record.labels.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

void Report(const Run& run, const slam::SparseMapper& mapper) {
  const size_t keyframes_made = slam::SparseMapperInspector(mapper).keyframes_made();
  const auto keyframes = static_cast<double>(keyframes_made);
  std::printf("frames %zu keyframes %zu (one per %.1f frames) points %zu\n", run.frames, keyframes_made,
              static_cast<double>(run.frames) / keyframes, mapper.points());
  std::printf("tracker %.2f ms/frame, mapper %.2f ms/keyframe (slowest %.1f), user time\n",
              1e3 * run.track_s / static_cast<double>(run.frames), 1e3 * run.map_s / keyframes, 1e3 * run.slowest_s);
  std::map<uint16_t, size_t> points_of_label;
  for (const auto& [id, record] : run.points) ++points_of_label[MostFrequentLabel(record)];
  std::map<uint16_t, std::vector<double>> errors_of_label;
  std::vector<double> all_errors;
  for (const ObservedPoint& observed : run.observations) {
    const auto it = run.points.find(observed.point);
    if (it == run.points.end() || observed.true_depth_mu <= 0) continue;
    const double depth_mu = (observed.T_camera_world * it->second.point.position_world).z();
    const double error = std::abs(depth_mu / observed.true_depth_mu - 1);
    errors_of_label[observed.label].push_back(error);
    all_errors.push_back(error);
  }
  std::printf("relative depth error of observations: median %.4f, 90 %% %.4f (%zu)\n", QuantileOrNan(all_errors, 0.5),
              QuantileOrNan(all_errors, 0.9), all_errors.size());
  for (const auto& [label, count] : points_of_label) {
    const std::vector<double>& errors = errors_of_label[label];
    std::printf("label %2d: %5zu points, %6zu observations, depth error median %.4f, 90 %% %.4f\n", label, count,
                errors.size(), QuantileOrNan(errors, 0.5), QuantileOrNan(errors, 0.9));
  }
}

absl::Status Bench(const std::string& dir, slam::SlamConfig config, bool sensor_depth) {
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence, files::Sequence::Open(dir, {.use_depth = true}));
  slam::LocalMapSlot local_map;
  slam::Tracker tracker(config, PoseUse::kGiven, &local_map);
  slam::SparseMapper mapper(config, &local_map, slam::SparseMapper::Background::kNothing);
  Run run;
  for (size_t i = 0; i < sequence.size(); ++i) {
    ROMAP_ASSIGN_OR_RETURN(FrameInput input, sequence.Load(i));
    const cv::Mat true_depth_mu = DecodeFrame(input, sequence.camera())->depth_mu;
    if (!sensor_depth) input.depth.clear();
    const auto frame = DecodeFrame(input, sequence.camera());
    const double start_s = UserSeconds();
    const slam::TrackedImage image = tracker.Track(frame);
    const double tracked_s = UserSeconds();
    run.track_s += tracked_s - start_s;
    ++run.frames;
    const slam::MappedFrame mapped = mapper.Process(image);
    if (!mapped.view) continue;
    const double mapped_s = UserSeconds();
    run.map_s += mapped_s - tracked_s;
    run.slowest_s = std::max(run.slowest_s, mapped_s - tracked_s);
    Record(*mapped.view, true_depth_mu, run);
  }
  Report(run, mapper);
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: slam_bench DIR [--sensor-depth] [--set slam.FIELD=VALUE]...\n");
    return 2;
  }
  slam::SlamConfig config;
  ConfigFields fields;
  fields.Section("slam");
  config.Fields(fields);
  std::vector<std::string> assignments;
  bool sensor_depth = false;
  for (int i = 2; i < argc; ++i) {
    if (std::strcmp(argv[i], "--sensor-depth") == 0) sensor_depth = true;
    if (std::strcmp(argv[i], "--set") == 0 && i + 1 < argc) assignments.emplace_back(argv[++i]);
  }
  absl::Status status = fields.Load("", assignments);
  if (status.ok()) status = Bench(argv[1], config, sensor_depth);
  if (!status.ok()) std::fprintf(stderr, "slam_bench: %s\n", Message(status).c_str());
  return status.ok() ? 0 : 1;
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) { return romap::measure::Main(argc, argv); }
