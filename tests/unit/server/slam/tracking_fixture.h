#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "common/statistics.h"
#include "server/slam/geometry/similarity.h"
#include "server/slam/sparse_mapper.h"
#include "server/slam/tracker.h"
#include "tests/support/sparse_mapper_inspector.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam {

// Tracker and SparseMapper together, frame by frame on one thread, in a synthetic world.
class TrackingTest : public ::testing::Test {
 protected:
  explicit TrackingTest(PoseUse pose_use = PoseUse::kIgnore, int width_px = 480, int height_px = 360)
      : world_(width_px, height_px) {
    Restart(pose_use);
  }

  void Restart(PoseUse pose_use, SparseMapper::Background background = SparseMapper::Background::kNothing) {
    slot_ = std::make_unique<LocalMapSlot>();
    mapper_ = std::make_unique<SparseMapper>(SlamConfig{}, slot_.get(), background);
    tracker_ = std::make_unique<Tracker>(SlamConfig{}, pose_use, slot_.get());
    frames_.clear();
  }

  const SlamMap& map() const { return SparseMapperInspector(*mapper_).map(); }

  // A path with parallax: an arc above the plate.
  static SE3<World, Camera> Pose(int i) {
    const double angle_rad = 0.02 * i;
    return TexturedWorld::LookAt({1.5 * std::cos(angle_rad), 1.5 * std::sin(angle_rad), 1.3 + 0.1 * std::sin(0.1 * i)},
                                 {0, 0, 0.1});
  }

  std::shared_ptr<Frame> Render(int i) const { return world_.Render(static_cast<uint64_t>(i + 1), Pose(i)); }

  // `truth`: of a frame without a pose, for Error().
  TrackingState ProcessFrame(std::shared_ptr<const Frame> frame, const SE3<World, Camera>& truth = {}) {
    image_ = tracker_->Track(frame);
    mapped_ = mapper_->Process(image_);
    const TrackingState state = image_.tracked.state;
    if (state == TrackingState::kTracking || state == TrackingState::kRelocalized) {
      frames_.push_back({mapped_.tracked, frame->T_world_camera.value_or(truth)});
      frames_.back().tracked.frame = nullptr;
    }
    return state;
  }

  // Processes the frames 0..end-1 and returns the number of frames until initialization. Expects that tracking is not
  // lost afterward.
  int ProcessFrames(int end) {
    int initializing = 0;
    for (int i = 0; i < end; ++i) {
      const TrackingState state = ProcessFrame(Render(i));
      if (state == TrackingState::kInitializing && initializing == i) {
        ++initializing;
      } else {
        EXPECT_EQ(state, TrackingState::kTracking) << i << ": " << reason();
      }
    }
    return initializing;
  }

  // Why the newest frame is not tracked.
  const std::string& reason() const { return image_.tracked.reason; }

  bool HasWarning(const std::string& name) const {
    const std::vector<Diagnostic> diagnostics = mapper_->Diagnostics();
    return std::any_of(diagnostics.begin(), diagnostics.end(),
                       [&](const Diagnostic& diagnostic) { return diagnostic.code == name; });
  }

  struct TrackedPose {
    TrackedFrame tracked;
    SE3<World, Camera> truth;
  };

  // Largest distance of a tracked camera from the truth after alignment by the best similarity, in the truth's units;
  // and the scale of that similarity.
  std::pair<double, double> Error() const {
    std::vector<Eigen::Vector3d> estimated, truth;
    for (const TrackedPose& frame : frames_) {
      estimated.push_back(CurrentPose(frame.tracked).translation());
      truth.push_back(frame.truth.translation());
    }
    return WorstDistance(estimated, truth);
  }

  // Largest distance between corresponding points after alignment by the best similarity, and its scale.
  static std::pair<double, double> WorstDistance(const std::vector<Eigen::Vector3d>& estimated,
                                                 const std::vector<Eigen::Vector3d>& truth) {
    const auto S = AlignPoints<World, World>(estimated, truth, false);
    if (!S) return {1e9, 0};
    double worst = 0;
    for (size_t i = 0; i < estimated.size(); ++i) worst = std::max(worst, (*S * estimated[i] - truth[i]).norm());
    return {worst, S->scale()};
  }

  // The shares of the tracked frames whose position and rotation errors are within the 95 % bounds of their current
  // uncertainty, and the median of the bounds over the median of the position errors.
  struct Coverage {
    double position = 0, rotation = 0, bound_ratio = 0;
  };
  Coverage MeasureCoverage(bool fix_scale) const {
    std::vector<Eigen::Vector3d> estimated, truth;
    for (const TrackedPose& frame : frames_) {
      estimated.push_back(CurrentPose(frame.tracked).translation());
      truth.push_back(frame.truth.translation());
    }
    const auto S = AlignPoints<World, World>(estimated, truth, fix_scale);
    Coverage coverage;
    std::vector<double> errors, bounds;
    for (const TrackedPose& frame : frames_) {
      const auto reference = map().KeyframeUncertainty(frame.tracked.reference);
      if (!frame.tracked.uncertainty || !reference) continue;
      const PoseUncertainty uncertainty = Combine(*reference, frame.tracked.reference_uncertainty);
      const SE3<World, Camera> pose = S->Moved(CurrentPose(frame.tracked));
      errors.push_back((pose.translation() - frame.truth.translation()).norm());
      bounds.push_back(kSigmasTo95 * S->scale() * uncertainty.position_sigma_mu);
      const double share = 1.0 / static_cast<double>(frames_.size());
      coverage.position += errors.back() <= bounds.back() ? share : 0;
      const double rotation_rad = pose.rotation().angularDistance(frame.truth.rotation());
      coverage.rotation += rotation_rad <= kSigmasTo95 * uncertainty.rotation_sigma_rad ? share : 0;
    }
    coverage.bound_ratio = errors.empty() ? 0 : Median(bounds) / Median(errors);
    return coverage;
  }

  SE3<World, Camera> CurrentPose(const TrackedFrame& tracked) const {
    const auto reference = map().KeyframePose(tracked.reference);
    return reference ? reference->Compose(tracked.T_reference_camera) : tracked.T_world_camera;
  }

  // Angle between the true up direction and the map's, which is z.
  double UpError_deg() const {
    const TrackedPose& last = frames_.back();
    const auto reference = map().KeyframePose(last.tracked.reference);
    const Eigen::Quaterniond R_world_camera =
        reference->T_world_camera.rotation() * last.tracked.T_reference_camera.rotation();
    const Eigen::Vector3d up_in_map = R_world_camera * (last.truth.rotation().conjugate() * Eigen::Vector3d::UnitZ());
    return std::acos(std::min(1.0, up_in_map.z())) * 180 / std::numbers::pi;
  }

  // Labels a rectangle of the floor as the only object: a tile without height.
  void LabelTile(Frame& frame) const {
    std::vector<cv::Point> corners_px;
    for (const auto& [x, y] : {std::pair{0.25, 0.35}, {0.65, 0.35}, {0.65, 0.8}, {0.25, 0.8}}) {
      const Eigen::Vector2d pixel_px = frame.camera.Project(frame.T_world_camera->Inverse() * Eigen::Vector3d(x, y, 0));
      corners_px.emplace_back(static_cast<int>(pixel_px.x()), static_cast<int>(pixel_px.y()));
    }
    frame.labels.setTo(0);
    cv::fillConvexPoly(frame.labels, corners_px, cv::Scalar(TexturedWorld::kPlateLabel));
  }

  // Removes the masks from the frame and returns them, as if a slow detector sent them later.
  static FrameMasks TakeMasks(Frame& frame) {
    FrameMasks masks{.frame_id = frame.frame_id, .labels = frame.labels, .instances = frame.instances};
    frame.has_masks = false;
    frame.labels.release();
    frame.instances.clear();
    return masks;
  }

  const TexturedWorld world_;
  std::unique_ptr<LocalMapSlot> slot_;
  std::unique_ptr<SparseMapper> mapper_;
  std::unique_ptr<Tracker> tracker_;
  std::vector<TrackedPose> frames_;
  TrackedImage image_;  // the newest one, and what became of it
  MappedFrame mapped_;
};

}  // namespace romap::slam
