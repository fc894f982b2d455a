#include "server/nerf/object_field.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <utility>

#include "common/map_motion.h"
#include "common/status.h"
#include "common/thread_time.h"
#include "server/nerf/field_sampler.h"
#include "server/nerf/field_surface.h"
#include "server/nerf/hull_distance.h"
#include "server/nerf/math/random.h"
#include "server/nerf/model/step_source.h"
#include "server/nerf/view_check.h"

namespace romap::nerf {
namespace {

constexpr int kMostDivergences = 3;
constexpr double kLeastNewShift = 0.01;  // of the box's side: a view that moved so far is judged anew

// Limits of carrying a field over to another box; beyond them a new training costs no more.
constexpr double kMostUnknownShare = 0.8;    // of the new box, that lies outside the old one
constexpr double kLeastFeatureShare = 0.25;  // see Trainer::ShrinkFeatures
constexpr double kMostGrowth = 2.5;          // of the longest side since the hash grid was laid out

NerfConfig WithWholeWidths(NerfConfig config) {
  config.hidden_width = (config.hidden_width + 15) / 16 * 16;
  return config;
}

constexpr double kBlack = 4;  // mean 8-bit value of an object's pixels

bool IsBlack(const ObjectView& view) {
  const cv::Scalar mean = cv::mean(view.color_bgr, view.ray_kind == static_cast<int>(RayKind::kObject));
  return mean[0] + mean[1] + mean[2] < 3 * kBlack;
}

// Of two runs one after the other; the loss is that of the later one.
void Add(const TrainStats& more, TrainStats& total) {
  total.steps += more.steps;
  total.rays += more.rays;
  total.samples += more.samples;
  total.active_samples += more.active_samples;
  total.color_loss = more.color_loss;
  total.wall_s += more.wall_s;
  total.look_cpu_s += more.look_cpu_s;
  total.restarted |= more.restarted;
  for (size_t p = 0; p < total.phase_cpu_s.size(); ++p) total.phase_cpu_s[p] += more.phase_cpu_s[p];
}

}  // namespace

ObjectField::ObjectField(const NerfConfig& config, ObjectId id, uint64_t seed)
    : config_(WithWholeWidths(config)),
      id_(id),
      seed_(seed),
      hull_(config_),
      rays_(config_, seed),
      refiner_(config_),
      occupancy_(config_),
      plan_(config_),
      trainer_(nerf::MakeTrainer(config_, seed)) {}

absl::Status ObjectField::SetBox(const Cuboid& cuboid_new) {
  const absl::Status status = FitBox(cuboid_new);
  box_fault_ = Message(status);
  return status;
}

absl::Status ObjectField::FitBox(const Cuboid& cuboid_new) {
  ROMAP_RETURN_IF_ERROR(ValidateCuboid(cuboid_new));
  const Cuboid cuboid = Moved(S_new_first_.Inverse(), cuboid_new);
  if (has_box_ && box_.StillFits(cuboid)) return absl::OkStatus();
  if (!has_box_ || !CarryOverTo(box_.Refitted(cuboid, config_.box_enlargement))) {
    box_ = TrainingBox::Around(cuboid, config_.box_enlargement);
    if (has_box_) Restart();
  }
  has_box_ = true;
  divergences_ = 0;
  views_changed_ = !views_.empty();
  RebuildHull();
  return absl::OkStatus();
}

// Goes on in `box` with what was learned, if that has enough in common with the present one.
bool ObjectField::CarryOverTo(const TrainingBox& box) {
  const double unknown_share = 1 - box_.ShareCovered(box);
  const double growth = box.LongestSide_mu() / box.unit_mu;
  if (unknown_share > kMostUnknownShare || growth > kMostGrowth || growth < 1 / kMostGrowth) return false;
  occupancy_.MoveTo(box_.ShareOf(box).cast<float>());
  // A box that was too small made the field paint what lies outside on the box's walls. That must be able to go.
  // Only so far over all boxes together: output weights that outgrow their features make training diverge.
  const double looseness = std::max(kLeastFeatureShare, loosened_ * (1 - 3 * unknown_share));
  trainer_->ShrinkFeatures(static_cast<float>(looseness / loosened_));
  loosened_ = looseness;
  plan_.OnNewBox(steps(), unknown_share);
  box_ = box;
  return true;
}

absl::Status ObjectField::AddView(ObjectView view) {
  if (!has_box_) return Refuse(FailedPrecondition("{}: a view came before the box", id_.ToString()));
  if (view.object != id_) {
    return Refuse(FailedPrecondition("{}: a view of {} was offered", id_.ToString(), view.object.ToString()));
  }
  view = Moved(S_new_first_.Inverse(), std::move(view));
  if (absl::Status status = ValidateView(view, box_); !status.ok()) return Refuse(std::move(status));
  const SE3<World, Camera> T_given = view.T_world_camera;
  refiner_.OnView(TakeView(std::move(view), false), T_given);
  plan_.OnNewView(steps());
  return absl::OkStatus();
}

void ObjectField::Move(const Sim3<World, World>& S_new_old) {
  if (!S_new_old.IsFinite()) {
    motion_refused_ = true;
    return;
  }
  S_new_first_ = S_new_old * S_new_first_;
}

absl::Status ObjectField::CorrectView(const ViewPose& pose) {
  const auto known = std::ranges::find(views_, pose.keyframe, &ObjectView::keyframe);
  if (known == views_.end()) return absl::OkStatus();
  const auto index = static_cast<size_t>(known - views_.begin());
  const SE3<World, Camera> T_given = S_new_first_.Inverse().Moved(pose.T_world_camera);
  ObjectView corrected = *known;
  corrected.T_world_camera = T_given;
  if (absl::Status status = ValidateView(corrected, box_); !status.ok()) return Refuse(std::move(status));
  const double shift_share = ShiftShare(refiner_.given(index), T_given);
  const bool is_close = shift_share < kLeastNewShift;
  if (is_close) corrected.T_world_camera = WithRefinement(index, T_given);
  TakeView(std::move(corrected), is_close);
  refiner_.OnView(index, T_given);
  plan_.OnCorrectedView(steps(), shift_share);
  return absl::OkStatus();
}

absl::Status ObjectField::Refuse(absl::Status why) {
  ++refused_views_;
  view_fault_ = Message(why);
  return why;
}

// A new pose of a view with the refinement that its old one has had.
SE3<World, Camera> ObjectField::WithRefinement(size_t index, const SE3<World, Camera>& T_world_camera) const {
  const auto seen_from = [&](const SE3<World, Camera>& pose) { return pose.Inverse() * box_.T_world_object; };
  const ObjectMotion found = MotionBetween(seen_from(refiner_.given(index)), seen_from(views_[index].T_world_camera));
  return box_.T_world_object * Moved(seen_from(T_world_camera), found).Inverse();
}

// The view is in the first world. Returns its index.
size_t ObjectField::TakeView(ObjectView view, bool keep_verdict) {
  divergences_ = 0;
  views_changed_ = true;
  auto same = std::ranges::find(views_, view.keyframe, &ObjectView::keyframe);
  if (same == views_.end() && views() >= config_.max_views) {
    same = views_.begin() + static_cast<std::ptrdiff_t>(MostRedundantView(view));
  }
  const auto index = static_cast<size_t>(same - views_.begin());
  if (same != views_.end()) {
    if (trust_.trusted(index)) WithdrawVote(index);
    *same = std::move(view);
  } else {
    views_.push_back(std::move(view));
  }
  if (!keep_verdict) trust_.OnView(index, steps());
  if (trust_.trusted(index)) VoteOnHull(index);
  return index;
}

// How far a view moved against the box, in sides of the box: by the corner that moved most in the camera's frame.
double ObjectField::ShiftShare(const SE3<World, Camera>& T_old, const SE3<World, Camera>& T_new) const {
  const SE3<Camera, Object> T_old_object = T_old.Inverse() * box_.T_world_object;
  const SE3<Camera, Object> T_new_object = T_new.Inverse() * box_.T_world_object;
  double largest_mu = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    const Eigen::Vector3d p = sign.cwiseProduct(box_.half_extents);
    largest_mu = std::max(largest_mu, (T_new_object * p - T_old_object * p).norm());
  }
  return largest_mu / box_.LongestSide_mu();
}

// The view whose direction to the object is nearest to that of `view`.
size_t ObjectField::MostRedundantView(const ObjectView& view) const {
  const Eigen::Vector3d center = box_.T_world_object.translation();
  const auto direction = [&](const ObjectView& v) { return (v.T_world_camera.translation() - center).normalized(); };
  const Eigen::Vector3d wanted = direction(view);
  size_t best = 0;
  double best_cosine = -std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < views_.size(); ++i) {
    const double cosine = wanted.dot(direction(views_[i]));
    if (cosine > best_cosine) {
      best_cosine = cosine;
      best = i;
    }
  }
  return best;
}

void ObjectField::PrepareViews() {
  if (!views_changed_) return;
  JudgeDepths();
  rays_.Build(views_, box_, depths_fit_);
  probe_.Build(rays_, views_.size());
  rays_.Weigh(trust_.Weights());
  black_views_ = static_cast<int>(std::ranges::count_if(views_, IsBlack));
  share_in_box_ = probe_.ShareMeeting(Space().extent);
  occupancy_.SetHull(hull_.Carve());
  views_changed_ = false;
  gain_.Restart();
  gain_.Record(steps(), probe_.Look(trainer_->model(), config_, Space()).Loss(trust_.Weights()));
}

void ObjectField::Restart() {
  ++restarts_;
  trainer_ = nerf::MakeTrainer(config_, nerf::RandomBits(seed_, 5, restarts_));
  occupancy_.Reset();
  plan_.Restart();
  trust_.Restart();
  if (has_box_) RebuildHull();
  loosened_ = 1;
  gain_.Restart();
  loss_ = 0;
}

TrainStats ObjectField::Train(int steps, int threads) {
  if (!has_box_ || views_.empty()) return {};
  PrepareViews();
  if (rays_.empty()) return {};
  TrainStats total;
  while (total.steps < steps && !total.restarted) {
    const uint64_t until_look = StepsUntilLook();
    const uint64_t run = std::min(static_cast<uint64_t>(steps - total.steps), until_look);
    Add(RunSteps(static_cast<int>(run), threads), total);
    if (!total.restarted && run == until_look) {
      const auto start = std::chrono::steady_clock::now();
      const double start_cpu_s = ThreadCpuSeconds();
      Look();
      total.look_cpu_s += ThreadCpuSeconds() - start_cpu_s;
      total.wall_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
  }
  train_seconds_ += total.wall_s;
  loss_ = total.color_loss;
  return total;
}

// It looks at every so many steps and at the end of the plan, however training is cut into slices.
uint64_t ObjectField::StepsUntilLook() const {
  const auto interval = static_cast<uint64_t>(config_.probe_interval_steps);
  const uint64_t until_look = interval - steps() % interval, planned = plan_.AllowedSteps(views(), true);
  return planned > steps() ? std::min(until_look, planned - steps()) : until_look;
}

TrainStats ObjectField::RunSteps(int steps, int threads) {
  const nerf::RenderSpace space = Space();
  const nerf::StepSource source{
      .ray = [this](uint64_t step, int index) { return rays_.Get(step, index); },
      .learning_rate = [this](uint64_t step) { return static_cast<float>(plan_.LearningRate(step)); },
      .progress = [this](uint64_t step) { return static_cast<float>(plan_.Progress(step)); },
      .extent = space.extent,
      .grid = space.grid};
  if (trainer_->model().IsDistance() && trainer_->steps_done() == 0) {
    trainer_->FitDistances(source, DistanceToBorder(occupancy_.hull(), box_.ExtentUnit()));
  }
  TrainStats stats = trainer_->Run(source, occupancy_, steps, std::clamp(threads, 1, 64));
  if (!trainer_->model().IsFinite()) {
    spdlog::warn("{}: training diverged after {} steps with {} views; starting anew", id_.ToString(),
                 trainer_->steps_done(), views());
    ++divergences_;
    Restart();
    stats.restarted = true;
  }
  return stats;
}

bool ObjectField::CanTrain() const { return divergences_ < kMostDivergences; }

uint64_t ObjectField::AllowedSteps(bool complete) const {
  return CanTrain() ? plan_.AllowedSteps(views(), complete) : 0;
}

FieldSnapshot ObjectField::Snapshot() const {
  FieldSnapshot snapshot;
  snapshot.object = id_;
  snapshot.steps = steps();
  snapshot.train_seconds = train_seconds_;
  snapshot.loss = loss_;
  snapshot.views = views();
  snapshot.warning = Concern();
  const TrainingBox box = box_.Moved(S_new_first_);
  snapshot.S_new_first = S_new_first_;
  snapshot.T_world_object = box.T_world_object;
  snapshot.box_half_extents = box.half_extents.cast<float>();
  DescribeSurface(config_, trainer_->model(), box, snapshot);
  snapshot.hull = {nerf::kOccupancyResolution, occupancy_.TrimmedHull(config_.hull_trim_share)};
  for (size_t i = 0; i < views_.size(); ++i) {
    if (!trust_.trusted(i)) continue;
    const ObjectView& view = views_[i];
    const SE3<Camera, Object> T_camera_object = view.T_world_camera.Inverse() * box_.T_world_object;
    snapshot.cameras.push_back({{T_camera_object.rotation(), S_new_first_.scale() * T_camera_object.translation()},
                                view.camera,
                                view.roi_px,
                                view.ray_kind});
  }
  snapshot.field = std::make_shared<TrainedField>(trainer_->model().Clone(), box);
  return snapshot;
}

}  // namespace romap::nerf
