#include "server/nerf/pose_refiner.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/statistics.h"

namespace romap::nerf {
namespace {

constexpr size_t kFewestViews = 6;  // fewer do not tell who is wrong
constexpr size_t kPixels = 100;     // of a view, of each kind
constexpr double kGain = 0.7;       // of what is found, which is noisy: the next looks see the rest
constexpr double kStill_px = 0.3;   // views that move less need not be looked at so soon

// The standard deviation that cameras are believed to have, besides its upper bound.
constexpr double kLeastPrior_px = 1;
constexpr double kPriorPerError = 2;

Eigen::Vector3d RotationVector(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

std::vector<RenderedPixel> Render(const ObjectView& view, uint16_t index, std::span<const cv::Point> pixels,
                                  const TrainingBox& box, const RaySet& ray_set, const nerf::FieldModel& model,
                                  const NerfConfig& config, const nerf::RenderSpace& space) {
  constexpr float kSomething = 0.1f;  // opacity from which there is a depth
  std::vector<nerf::Ray> rays;
  for (const cv::Point& at : pixels) {
    const TrainingPixel pixel{index, static_cast<uint16_t>(at.x), static_cast<uint16_t>(at.y), {}, 0};
    rays.push_back(ray_set.Through(pixel, true, 0.5f));
    rays.back().target.depth = 0;  // so that the excess is the depth itself, times the opacity
  }
  const std::vector<nerf::RayResult> results = nerf::RenderRays(model, config, space, rays);
  const double middle_z_mu = (view.T_world_camera.Inverse() * box.T_world_object.translation()).z();
  std::vector<RenderedPixel> rendered;
  for (size_t i = 0; i < results.size(); ++i) {
    const nerf::RayResult& result = results[i];
    const Eigen::Vector3d direction((pixels[i].x - view.camera.cx_px) / view.camera.fx_px,
                                    (pixels[i].y - view.camera.cy_px) / view.camera.fy_px, 1);
    const double z_mu = result.opacity > kSomething
                            ? result.depth_error / result.opacity * box.unit_mu / direction.norm()
                            : middle_z_mu;
    rendered.push_back(
        {pixels[i].x, pixels[i].y, z_mu * direction, {result.rgb[2], result.rgb[1], result.rgb[0]}, result.opacity});
  }
  return rendered;
}

// How far an object's middle moves in the picture.
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
  return config_.pose_prior_px > 0 && views >= kFewestViews && step >= next_step_;
}

void PoseRefiner::Refine(std::span<ObjectView> views, std::span<const float> weights, const TrainingBox& box,
                         const RaySet& rays, const nerf::FieldModel& model, const nerf::RenderSpace& space,
                         uint64_t step) {
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
  GiveUpOutliers(views, weights, box);
  RemoveCommonMotion(views, weights, box);
  prior_px_ = std::clamp(kPriorPerError * TypicalError_px(views, weights, box),
                         std::min(kLeastPrior_px, config_.pose_prior_px), config_.pose_prior_px);
  double square = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    const double shift_px = Shift_px(views[i], before[i], views[i].T_world_camera.Inverse() * box.T_world_object);
    square += shift_px * shift_px;
  }
  const double moved_px = std::sqrt(square / static_cast<double>(views.size()));
  if (moved_px < kStill_px) interval_steps_ *= 2;
  next_step_ = step + interval_steps_;
}

// A view that is much further off than the others is not a little off but wrong. It must not be bent until it fits
// somewhere, but stay as odd as it is, so that it is seen to be.
void PoseRefiner::GiveUpOutliers(std::span<ObjectView> views, std::span<const float> weights,
                                 const TrainingBox& box) const {
  constexpr double kPerTypicalError = 3, kAlways_px = 2;
  const double most_px = kAlways_px + kPerTypicalError * TypicalError_px(views, weights, box);
  for (size_t i = 0; i < views.size(); ++i) {
    const double error_px = Shift_px(views[i], given_[i].Inverse() * box.T_world_object,
                                     views[i].T_world_camera.Inverse() * box.T_world_object);
    if (weights[i] <= 0 || error_px > most_px) views[i].T_world_camera = given_[i];
  }
}

// Standard deviation, along each axis of the picture, of where cameras were told to be. Single cameras that are far off
// do not make it larger.
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

// A similarity of the object's space takes a camera at c to one that is turned alike, and shifted by shift + growth c:
// the part of the changes that looks like one, by least squares, is taken back.
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
