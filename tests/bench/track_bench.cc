// Tracks the camera through a recorded sequence from its images, with the tracking and mapping of a server but without
// objects, and writes the trajectories.
//
//   track_bench DIR --out FOLDER [--set slam.FIELD=VALUE]... [--depth] [--poses given|prior|ignore] [--cut A:B]
//               [--until N] [--one-thread] [--fps RATE] [--readout-ms MS] [--verbose]
//
// Writes FOLDER/trajectory.txt with the final pose of every frame and FOLDER/live.txt with the poses as tracking first
// estimated them (TUM format), both with their uncertainties (trajectory_uncertainty.txt, live_uncertainty.txt). Prints
// how many errors of the final poses are within the bounds of their uncertainty, the numbers of tracked and lost
// frames, the times per frame and per bundle adjustment, and the time of cv::ORB::detectAndCompute with the same number
// of features. --cut skips the frames A..B-1. --one-thread maps between the frames instead of on a thread, so that the
// same input gives the same result.

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <opencv2/core/utility.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <thread>
#include <vector>

#include "client/eval/trajectory_eval.h"
#include "client/files/pose_uncertainty_file.h"
#include "client/files/sequence.h"
#include "client/files/tum.h"
#include "common/bounded_queue.h"
#include "common/config.h"
#include "common/statistics.h"
#include "common/status.h"
#include "server/session/ingest.h"
#include "server/session/trajectory.h"
#include "server/slam/sparse_mapper.h"
#include "server/slam/tracker.h"
#include "tests/support/sparse_mapper_inspector.h"

namespace romap::measure {
namespace {

using Clock = std::chrono::steady_clock;

double Seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

// Lower quantile; 0 without values.
double QuantileOrZero(const std::vector<double>& values, double share) {
  return values.empty() ? 0 : LowerQuantile(values, share);
}

struct Options {
  std::string sequence;
  std::string out;
  slam::SlamConfig slam;
  bool depth = false;
  PoseUse poses = PoseUse::kIgnore;
  size_t cut_begin = 0, cut_end = 0;
  size_t until = 1 << 30;
  bool one_thread = false;
  bool verbose = false;
  double fps = 0;
  std::optional<double> readout_s;
};

Options Parse(int argc, char** argv) {
  Options options;
  ConfigFields fields;
  fields.Section("slam");
  options.slam.Fields(fields);
  std::vector<std::string> sets;
  for (int i = 1; i < argc; ++i) {
    const std::string arg = argv[i];
    const auto value = [&] { return std::string(i + 1 < argc ? argv[++i] : ""); };
    if (arg == "--out") {
      options.out = value();
    } else if (arg == "--set") {
      sets.push_back(value());
    } else if (arg == "--depth") {
      options.depth = true;
    } else if (arg == "--poses") {
      const std::string poses = value();
      options.poses = poses == "given" ? PoseUse::kGiven : poses == "prior" ? PoseUse::kPrior : PoseUse::kIgnore;
    } else if (arg == "--cut") {
      std::sscanf(value().c_str(), "%zu:%zu", &options.cut_begin, &options.cut_end);
    } else if (arg == "--until") {
      options.until = std::stoul(value());
    } else if (arg == "--one-thread") {
      options.one_thread = true;
    } else if (arg == "--verbose") {
      options.verbose = true;
      spdlog::set_level(spdlog::level::debug);
    } else if (arg == "--readout-ms") {
      options.readout_s = 1e-3 * std::stod(value());
    } else if (arg == "--fps") {
      options.fps = std::stod(value());
    } else {
      options.sequence = arg;
    }
  }
  if (const absl::Status status = fields.Load("", sets); !status.ok()) {
    std::fprintf(stderr, "track_bench: %s\n", Message(status).c_str());
    std::exit(2);
  }
  return options;
}

// A frame with a pose.
struct TimedFrame {
  int64_t timestamp_ns = 0;
  TrackedFrame tracked;
};

void Write(const std::filesystem::path& path, const std::vector<TimedFrame>& frames) {
  std::vector<files::StampedPose> poses;
  for (const TimedFrame& frame : frames) {
    poses.push_back({frame.timestamp_ns, frame.tracked.T_world_camera, frame.tracked.uncertainty});
  }
  const absl::Status status = files::WriteTrajectory(path.string(), poses);
  if (!status.ok()) std::fprintf(stderr, "track_bench: %s\n", Message(status).c_str());
}

slam::SparseMapper::Background BackgroundWork(const Options& options) {
  using Background = slam::SparseMapper::Background;
  if (options.one_thread) return Background::kNothing;
  return options.fps > 0 ? Background::kAllAdjustment : Background::kGlobalAdjustment;
}

class Run {
 public:
  explicit Run(Options options)
      : options_(std::move(options)),
        mapper_(options_.slam, &slot_, BackgroundWork(options_)),
        tracker_(options_.slam, options_.poses, &slot_),
        queue_(8) {}

  int operator()() {
    auto sequence =
        files::Sequence::Open(options_.sequence, {.use_depth = options_.depth, .readout_s = options_.readout_s});
    if (!sequence.ok()) {
      std::fprintf(stderr, "track_bench: %s\n", Message(sequence.status()).c_str());
      return 2;
    }
    cv::setNumThreads(1);
    session::Ingest ingest(sequence->camera(), /*max_mask_delay_s=*/0);
    std::thread mapping;
    if (!options_.one_thread) {
      mapping = std::thread([this] {
        while (std::optional<slam::TrackedImage> image = queue_.Pop()) Map(*image);
      });
    }
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(options_.slam.scene_features);
    const size_t count = std::min(sequence->size(), options_.until);
    const Clock::time_point begin = Clock::now();
    for (size_t i = 0; i < count; ++i) {
      if (i >= options_.cut_begin && i < options_.cut_end) continue;
      const auto input = sequence->Load(i);
      if (!input.ok()) {
        std::fprintf(stderr, "track_bench: %s\n", Message(input.status()).c_str());
        continue;
      }
      auto frame = ingest.Accept(*input);
      if (!frame.ok()) {
        std::fprintf(stderr, "frame %zu: %s\n", i, Message(frame.status()).c_str());
        continue;
      }
      if (i % 10 == 0) TimeOrb(**frame, *orb);
      if (options_.fps > 0) {
        std::this_thread::sleep_until(begin + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(
                                                  static_cast<double>(i) / options_.fps)));
      }
      Track(*frame);
    }
    queue_.Close();
    if (mapping.joinable()) mapping.join();
    const size_t keyframes_kept = Inspect().map().keyframes().size();
    trajectory_.Correct(mapper_.Finish());
    Report(keyframes_kept);
    return 0;
  }

 private:
  slam::SparseMapperInspector Inspect() const { return slam::SparseMapperInspector(mapper_); }

  void TimeOrb(const Frame& frame, cv::ORB& orb) {
    cv::Mat gray, descriptors;
    std::vector<cv::KeyPoint> keypoints;
    cv::cvtColor(frame.image_bgr, gray, cv::COLOR_BGR2GRAY);
    const Clock::time_point begin = Clock::now();
    orb.detectAndCompute(gray, cv::noArray(), keypoints, descriptors);
    orb_s_.push_back(Seconds(Clock::now() - begin));
  }

  void Track(const std::shared_ptr<const Frame>& frame) {
    const Clock::time_point begin = Clock::now();
    slam::TrackedImage image = tracker_.Track(frame);
    const TrackingState state = image.tracked.state;
    ++frames_;
    if (state == TrackingState::kInitializing) {
      ++initializing_;
      if (!has_tracked_) reason_ = image.tracked.reason;
      if (options_.verbose) fmt::print("frame {}: {}\n", frame->frame_id, image.tracked.reason);
    } else {
      if (!has_tracked_) first_tracked_ = frame->frame_id;
      has_tracked_ = true;
      track_s_.push_back(Seconds(Clock::now() - begin));
    }
    if (state == TrackingState::kLost) {
      ++lost_;
      lost_frames_ += fmt::format(" {}", frame->frame_id);
    }
    const bool has_pose = state == TrackingState::kTracking || state == TrackingState::kRelocalized;
    if (state == TrackingState::kRelocalized) relocalized_ += fmt::format(" {}", frame->frame_id);
    if (has_pose) {
      live_.push_back({frame->timestamp_ns, image.tracked});
      live_.back().tracked.frame = nullptr;
      std::lock_guard lock(final_mutex_);
      AddFinal(image.tracked);
    }
    if (options_.one_thread) return Map(image);
    const bool is_keyframe = image.tracked.is_keyframe;
    if (is_keyframe) mapper_.SetKeyframesWait(++waiting_ > 0);
    // As a live session: tracking waits for nothing, and mapping omits frames that are no keyframes when it is late.
    if (options_.fps == 0) {
      queue_.Push(std::move(image));
    } else if (!queue_.TryPush(image) && (is_keyframe || image.initial_views)) {
      queue_.ForcePush(std::move(image));
    }
  }

  void AddFinal(const TrackedFrame& tracked) {
    trajectory_.Add({.frame_id = tracked.frame->frame_id,
                     .timestamp_ns = tracked.frame->timestamp_ns,
                     .T_world_camera = tracked.T_world_camera,
                     .reference = tracked.reference,
                     .T_reference_camera = tracked.T_reference_camera,
                     .uncertainty = tracked.uncertainty,
                     .reference_uncertainty = tracked.reference_uncertainty});
    final_.push_back({tracked.frame->timestamp_ns, tracked});
    final_.back().tracked.frame = nullptr;
  }

  void Map(const slam::TrackedImage& image) {
    if (image.tracked.is_keyframe) mapper_.SetKeyframesWait(--waiting_ > 0);
    const Clock::time_point begin = Clock::now();
    const slam::MappedFrame mapped = mapper_.Process(image);
    if (mapped.view) map_s_.push_back(Seconds(Clock::now() - begin));
    const TrackedFrame& tracked = mapped.tracked;
    std::lock_guard lock(final_mutex_);
    if (mapped.correction) trajectory_.Correct(*mapped.correction);
    if (image.initial_views && mapped.view) AddFinal(tracked);
    if (!mapped.view) return;
    trajectory_.SetKeyframe(tracked.frame->frame_id, tracked.frame->timestamp_ns, mapped.view->id,
                            mapped.view->T_world_camera);
  }

  void Report(size_t keyframes_kept) {
    const std::vector<SE3<World, Camera>> poses = trajectory_.Poses();
    const std::vector<std::optional<PoseUncertainty>> uncertainties = trajectory_.Uncertainties();
    for (size_t i = 0; i < final_.size(); ++i) {
      final_[i].tracked.T_world_camera = poses[i];
      final_[i].tracked.uncertainty = uncertainties[i];
    }
    if (!options_.out.empty()) {
      std::filesystem::create_directories(options_.out);
      Write(std::filesystem::path(options_.out) / "trajectory.txt", final_);
      Write(std::filesystem::path(options_.out) / "live.txt", live_);
    }
    const size_t after = frames_ - initializing_;
    fmt::print("frames {}: initializing {}, tracked {} of {} later frames ({:.1f} %), lost {}, first tracked {}\n",
               frames_, initializing_, after - lost_, after,
               100.0 * static_cast<double>(after - lost_) / static_cast<double>(std::max<size_t>(1, after)), lost_,
               first_tracked_);
    if (lost_ > 0) fmt::print("lost:{}\n", lost_frames_);
    if (!relocalized_.empty()) fmt::print("relocalized:{}\n", relocalized_);
    if (!has_tracked_) fmt::print("never initialized: {}\n", reason_);
    ReportError(keyframes_kept);
    const slam::SparseMapperInspector mapping = Inspect();
    fmt::print(
        "keyframes {} made, {} kept; points {}; loops {} corrected, {} merged without correction; maps {} begun, {} "
        "merged; up confidence {:.2f}\n",
        mapping.keyframes_made(), keyframes_kept, mapper_.points(), mapping.loops_corrected(), mapping.loops_merged(),
        mapping.maps_begun(), mapping.maps_merged(), mapping.up_confidence());
    const double orb_ms = 1e3 * QuantileOrZero(orb_s_, 0.5);
    fmt::print("tracking: median {:.1f} ms, p99 {:.1f} ms, {:.2f} times cv::ORB ({:.1f} ms)\n",
               1e3 * QuantileOrZero(track_s_, 0.5), 1e3 * QuantileOrZero(track_s_, 0.99),
               1e3 * QuantileOrZero(track_s_, 0.5) / orb_ms, orb_ms);
    const slam::LocalAdjuster::Times& local = mapping.local_adjustment();
    fmt::print(
        "keyframe mapping: median {:.0f} ms, p99 {:.0f} ms; local adjustment: mean {:.0f} ms, longest {:.0f} ms\n",
        1e3 * QuantileOrZero(map_s_, 0.5), 1e3 * QuantileOrZero(map_s_, 0.99),
        1e3 * local.total_s / std::max(1, local.runs), 1e3 * local.longest_s);
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    fmt::print("peak memory {} MB\n", usage.ru_maxrss / 1024);
  }

  // Compares the trajectory with groundtruth.txt of the sequence, if it exists.
  void ReportError(size_t keyframes_kept) const {
    if (options_.out.empty() || final_.empty()) return;
    const std::string truth = options_.sequence + "/groundtruth.txt";
    const auto report =
        eval::EvaluateTrajectory({.estimated = options_.out + "/trajectory.txt",
                                  .ground_truth = truth,
                                  .alignment = options_.depth ? eval::Alignment::kSe3 : eval::Alignment::kSim3});
    if (!report.ok()) return;
    fmt::print("ATE rmse {:.3f} cm, {:.3f} % of the path of {:.2f} m, aligned by {}; scale {:.4f}; {} keyframes\n",
               100 * report->ate_rmse_m, 100 * report->ate_rmse_m / report->path_length_m, report->path_length_m,
               options_.depth ? "SE3" : "Sim3", report->scale, keyframes_kept);
    if (const auto& calibration = report->calibration) {
      fmt::print(
          "uncertainty: {:.1f} % of position and {:.1f} % of rotation errors within their 95 % bound; median bound "
          "over "
          "median error {:.2f} and {:.2f}\n",
          100 * calibration->position_coverage, 100 * calibration->rotation_coverage, calibration->position_bound_ratio,
          calibration->rotation_bound_ratio);
    }
    ReportUp(truth);
  }

  // Angle between the map's z axis and the true one, by the orientations of all cameras.
  void ReportUp(const std::string& truth_path) const {
    const auto truth = files::ReadTum(truth_path);
    if (!truth.ok()) return;
    Eigen::Vector3d up_sum = Eigen::Vector3d::Zero();
    for (const TimedFrame& frame : final_) {
      for (const files::StampedPose& pose : *truth) {
        if (std::abs(pose.timestamp_ns - frame.timestamp_ns) > 5'000'000) continue;
        const Eigen::Quaterniond R_map_truth =
            frame.tracked.T_world_camera.rotation() * pose.T_world_camera.rotation().conjugate();
        up_sum += R_map_truth * Eigen::Vector3d::UnitZ();
      }
    }
    if (up_sum.isZero()) return;
    fmt::print("up direction error {:.2f} deg\n",
               std::acos(std::clamp(up_sum.normalized().z(), -1.0, 1.0)) * 180 / std::numbers::pi);
  }

  Options options_;
  slam::LocalMapSlot slot_;
  slam::SparseMapper mapper_;
  slam::Tracker tracker_;
  BoundedQueue<slam::TrackedImage> queue_;
  std::atomic<int> waiting_ = 0;
  std::vector<TimedFrame> live_;
  std::mutex final_mutex_;
  std::vector<TimedFrame> final_;  // with the poses of `trajectory_`, after the end
  session::Trajectory trajectory_;
  std::vector<double> orb_s_, track_s_, map_s_;
  size_t frames_ = 0, initializing_ = 0, lost_ = 0;
  bool has_tracked_ = false;
  uint64_t first_tracked_ = 0;
  std::string lost_frames_, relocalized_, reason_;
};

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) { return romap::measure::Run(romap::measure::Parse(argc, argv))(); }
