#include "server/nerf/pose_refiner.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/statistics.h"
#include "server/nerf/cpu/ray_renderer.h"

namespace romap::nerf {
namespace {

constexpr size_t kMinViews = 6;  // with fewer views it is unknown which one is wrong
constexpr size_t kPixels = 100;  // per view: on the object, and on the outline
constexpr double kGain = 0.7;    // share of the noisy estimate that is applied; later refinements correct the rest
constexpr double kMinMotion_px = 0.3;  // RMS motion of the views below which the refinement interval doubles

// Standard deviation of the given poses. The configuration sets the upper bound.
constexpr double kMinPrior_px = 1;
constexpr double kPriorPerError = 2;

Eigen::Vector3d RotationVector(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

// Renders the field at `pixels` of a view. Where the field is transparent, the depth is that of the box center.
std::vector<RenderedPixel> Render(const ObjectView& view, uint16_t index, std::span<const cv::Point> pixels,
                                  const TrainingBox& box, const RaySet& ray_set, const FieldModel& model,
                                  const NerfConfig& config, const RenderSpace& space) {
  constexpr float kMinOpacity = 0.1f;  // of a pixel with depth
  std::vector<Ray> rays;
  for (const cv::Point& at : pixels) {
    const TrainingPixel pixel{index, static_cast<uint16_t>(at.x), static_cast<uint16_t>(at.y), {}, 0};
    rays.push_back(ray_set.Through(pixel, true, 0.5f));
    rays.back().target.depth = 0;  // makes depth_error the depth times the opacity
  }
  const std::vector<RayResult> results = RenderRays(model, config, space, rays);
  const double center_z_mu = (view.T_world_camera.Inverse() * box.T_world_object.translation()).z();
  std::vector<RenderedPixel> rendered;
  for (size_t i = 0; i < results.size(); ++i) {
    const RayResult& result = results[i];
    const Eigen::Vector3d direction((pixels[i].x - view.camera.cx_px) / view.camera.fx_px,
                                    (pixels[i].y - view.camera.cy_px) / view.camera.fy_px, 1);
    const double z_mu = result.opacity > kMinOpacity
                            ? result.depth_error / result.opacity * box.unit_mu / direction.norm()
                            : center_z_mu;
    rendered.push_back(
        {pixels[i].x, pixels[i].y, z_mu * direction, {result.rgb[2], result.rgb[1], result.rgb[0]}, result.opacity});
  }
  return rendered;
}

// The motion of the object's center in the image.
double Shift_px(const ObjectView& view, const SE3<Camera, Object>& T_from, const SE3<Camera, Object>& T_to) {
  return (view.camera.Project(T_to.translation()) - view.camera.Project(T_from.translation())).norm();
}

}  // namespace

void PoseRefiner::OnView(size_t index, const SE3<World, Camera>& T_world_camera) {
  if (index >= given_.size()) given_.resize(index + 1);
  given_[index] = T_world_camera;
  next_step_ = 0;
  interval_steps_ = static_cast<uint64_t>(config_.probe_interval_steps);
}

bool PoseRefiner::IsDue(size_t views, uint64_t step) const {
  return config_.pose_prior_px > 0 && views >= kMinViews && step >= next_step_;
}

void PoseRefiner::Refine(std::span<ObjectView> views, std::span<const float> weights, const TrainingBox& box,
                         const RaySet& rays, const FieldModel& model, const RenderSpace& space, uint64_t step) {
  const double prior_px = prior_px_ > 0 ? prior_px_ : config_.pose_prior_px;
  std::vector<SE3<Camera, Object>> before;
  for (size_t i = 0; i < views.size(); ++i) {
    const ViewAlignment alignment(views[i]);
    const std::vector<RenderedPixel> rendered =
        Render(views[i], static_cast<uint16_t>(i), alignment.Pixels(kPixels, step), box, rays, model, config_, space);
    const SE3<Camera, Object> T_given = given_[i].Inverse() * box.T_world_object;
    const SE3<Camera, Object> T_now = views[i].T_world_camera.Inverse() * box.T_world_object;
    const ObjectMotion motion = alignment.Align(rendered, T_now, MotionBetween(T_given, T_now), prior_px);
    views[i].T_world_camera = box.T_world_object * Moved(T_now, kGain * motion).Inverse();
    before.push_back(T_now);
  }
  ResetOutliers(views, weights, box);
  RemoveCommonMotion(views, weights, box);
  prior_px_ = std::clamp(kPriorPerError * TypicalError_px(views, weights, box),
                         std::min(kMinPrior_px, config_.pose_prior_px), config_.pose_prior_px);
  double square = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    const double shift_px = Shift_px(views[i], before[i], views[i].T_world_camera.Inverse() * box.T_world_object);
    square += shift_px * shift_px;
  }
  const double moved_px = std::sqrt(square / static_cast<double>(views.size()));
  if (moved_px < kMinMotion_px) interval_steps_ *= 2;
  next_step_ = step + interval_steps_;
}

// A view with a much larger error than the others is wrong rather than inaccurate. Its given pose is restored, so that
// ViewTrust can detect it; a pose that was fitted to wrong data would hide the error.
void PoseRefiner::ResetOutliers(std::span<ObjectView> views, std::span<const float> weights,
                                const TrainingBox& box) const {
  constexpr double kPerTypicalError = 3, kOffset_px = 2;
  const double max_px = kOffset_px + kPerTypicalError * TypicalError_px(views, weights, box);
  for (size_t i = 0; i < views.size(); ++i) {
    const double error_px = Shift_px(views[i], given_[i].Inverse() * box.T_world_object,
                                     views[i].T_world_camera.Inverse() * box.T_world_object);
    if (weights[i] <= 0 || error_px > max_px) views[i].T_world_camera = given_[i];
  }
}

// Standard deviation of the errors of the given poses, along each axis of the image. Robust against outliers.
double PoseRefiner::TypicalError_px(std::span<const ObjectView> views, std::span<const float> weights,
                                    const TrainingBox& box) const {
  constexpr double kMedianOfRayleigh = 1.1774;  // for a standard deviation of 1
  std::vector<double> errors_px;
  for (size_t i = 0; i < views.size(); ++i) {
    if (weights[i] <= 0) continue;
    errors_px.push_back(Shift_px(views[i], given_[i].Inverse() * box.T_world_object,
                                 views[i].T_world_camera.Inverse() * box.T_world_object));
  }
  if (errors_px.empty()) return 0;
  return Median(std::move(errors_px)) / kMedianOfRayleigh;
}

// A small similarity transform of the object's space rotates every camera by the same angle, and shifts a camera at c
// by shift + growth c. Subtracts the similarity transform that fits the changes of all cameras best, by least squares.
void PoseRefiner::RemoveCommonMotion(std::span<ObjectView> views, std::span<const float> weights,
                                     const TrainingBox& box) const {
  const SE3<Object, World> T_object_world = box.T_world_object.Inverse();
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();
  Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
  Eigen::Vector4d b = Eigen::Vector4d::Zero();
  double count = 0;
  std::vector<SE3<Object, Object>> changes;
  for (size_t i = 0; i < views.size(); ++i) {
    const SE3<Object, Camera> T_given = T_object_world * given_[i];
    changes.push_back(T_object_world * views[i].T_world_camera * T_given.Inverse());
    if (weights[i] <= 0) continue;
    Eigen::Matrix<double, 3, 4> J;
    J << Eigen::Matrix3d::Identity(), T_given.translation();
    A += J.transpose() * J;
    b += J.transpose() * changes[i].translation();
    turn_rad += RotationVector(changes[i].rotation());
    count += 1;
  }
  if (count == 0) return;
  turn_rad /= count;
  const Eigen::Vector4d common = A.ldlt().solve(b);
  if (!common.allFinite()) return;
  for (size_t i = 0; i < views.size(); ++i) {
    const Eigen::Vector3d left_rad = RotationVector(changes[i].rotation()) - turn_rad;
    const Eigen::Vector3d camera = T_object_world * given_[i].translation();
    const SE3<Object, Object> left(Eigen::Quaterniond(Eigen::AngleAxisd(left_rad.norm(), left_rad.stableNormalized())),
                                   changes[i].translation() - common.head<3>() - common[3] * camera);
    views[i].T_world_camera = box.T_world_object * left * T_object_world * given_[i];
  }
}

}  // namespace romap::nerf
