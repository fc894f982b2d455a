#include "server/nerf/object_field.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "common/map_motion.h"
#include "common/status.h"
#include "common/thread_time.h"
#include "server/nerf/field_sampler.h"
#include "server/nerf/field_surface.h"
#include "server/nerf/view_check.h"

namespace romap::nerf {
namespace {

constexpr int kMaxDivergences = 3;
constexpr uint64_t kMaskCheckSteps = 100;  // interval of the measurements of mask borders
// When the masks turn out to be less precise than assumed, training is extended as if this share of the box were new.
constexpr double kLostShare = 0.3;

bool IsBlack(const ObjectView& view) {
  constexpr double kMaxBlack = 4;  // mean 8-bit value over the object's pixels
  const cv::Scalar mean = cv::mean(view.color_bgr, view.ray_kind == static_cast<int>(RayKind::kObject));
  return mean[0] + mean[1] + mean[2] < 3 * kMaxBlack;
}

}  // namespace

ObjectField::ObjectField(const NerfConfig& config, ObjectId id, uint64_t seed)
    : config_(config), id_(id), field_(config_, seed), views_(config_), rays_(config_, seed), plan_(config_) {}

absl::Status ObjectField::SetBox(const Cuboid& cuboid) {
  const absl::Status status = FitBox(cuboid);
  warnings_.OnBox(status);
  return status;
}

absl::Status ObjectField::FitBox(const Cuboid& cuboid) {
  ROMAP_RETURN_IF_ERROR(ValidateCuboid(cuboid));
  const BoxedField::Fit fit = field_.FitTo(Moved(S_new_first_.Inverse(), cuboid));
  if (fit.change == BoxedField::BoxChange::kNone) return absl::OkStatus();
  if (fit.change == BoxedField::BoxChange::kTransferred) plan_.OnNewBox(steps(), fit.unknown_share);
  if (fit.change == BoxedField::BoxChange::kRestarted) ResetProgress();
  OnNewInput();
  RebuildHull();
  return absl::OkStatus();
}

absl::Status ObjectField::AddView(ObjectView view) {
  if (!field_.has_box()) return Reject(FailedPrecondition("{}: set the box before adding views", id_.ToString()));
  if (view.object != id_) {
    return Reject(FailedPrecondition("{}: cannot add a view of {}", id_.ToString(), view.object.ToString()));
  }
  view = Moved(S_new_first_.Inverse(), std::move(view));
  if (absl::Status status = ValidateView(view, field_.box()); !status.ok()) return Reject(std::move(status));
  if (absl::Status status = views_.Add(std::move(view), steps()); !status.ok()) return Reject(std::move(status));
  OnNewInput();
  plan_.OnNewView(steps());
  return absl::OkStatus();
}

void ObjectField::Move(const Sim3<World, World>& S_new_old) {
  if (!S_new_old.IsFinite()) {
    warnings_.OnInvalidCorrection();
    return;
  }
  S_new_first_ = S_new_old * S_new_first_;
}

absl::Status ObjectField::CorrectView(const ViewPose& pose) {
  const ViewPose pose_first{pose.keyframe, S_new_first_.Inverse().Moved(pose.T_world_camera)};
  const absl::StatusOr<std::optional<double>> shift_share = views_.Correct(pose_first, field_.box(), steps());
  if (!shift_share.ok()) return Reject(shift_share.status());
  if (!*shift_share) return absl::OkStatus();  // there is no such view
  OnNewInput();
  plan_.OnCorrectedView(steps(), **shift_share);
  return absl::OkStatus();
}

absl::Status ObjectField::Reject(absl::Status error) {
  warnings_.OnRejectedView(error);
  return error;
}

void ObjectField::OnNewInput() {
  divergences_ = 0;
  views_changed_ = !views_.empty();
}

TrainStats ObjectField::Train(int steps, int threads) {
  if (!field_.has_box() || views_.empty()) return {};
  PrepareViews();
  if (rays_.empty()) return {};
  TrainStats total;
  while (total.steps < steps && !total.restarted) {
    const uint64_t until_evaluation = StepsUntilEvaluation();
    const uint64_t run = std::min(static_cast<uint64_t>(steps - total.steps), until_evaluation);
    total.Append(RunSteps(static_cast<int>(run), threads));
    if (!total.restarted && run == until_evaluation) {
      const auto start = std::chrono::steady_clock::now();
      const double start_cpu_s = ThreadCpuSeconds();
      Evaluate();
      total.evaluation_cpu_s += ThreadCpuSeconds() - start_cpu_s;
      total.wall_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
  }
  train_seconds_ += total.wall_s;
  loss_ = total.color_loss;
  return total;
}

void ObjectField::PrepareViews() {
  if (!views_changed_) return;
  if (views_.CheckDepths()) RebuildHull();
  rays_.Build(views_.views(), field_.box(), views_.quality());
  probe_.Build(rays_, views_.size());
  rays_.Weigh(views_.Weights());
  warnings_.OnViewChecks({.views = views(),
                          .black_views = static_cast<int>(std::ranges::count_if(views_.views(), IsBlack)),
                          .mask_border_px = views_.quality().mask_border_px,
                          .depth_consistent = views_.quality().depth_is_consistent,
                          .share_intersecting_box = probe_.ShareIntersectingBox(field_.Space().extent)});
  field_.SetHull(views_.CarveHull());
  views_changed_ = false;
  loss_trend_.Restart();
  loss_trend_.Record(steps(), probe_.Measure(field_.model(), config_, field_.Space()).Loss(views_.Weights()));
}

// Evaluations are due at multiples of the interval and at the end of the plan, so they do not depend on how training is
// divided into slices.
uint64_t ObjectField::StepsUntilEvaluation() const {
  const auto interval = static_cast<uint64_t>(config_.probe_interval_steps);
  const uint64_t until_next = interval - steps() % interval, planned = plan_.AllowedSteps(views(), true);
  return planned > steps() ? std::min(until_next, planned - steps()) : until_next;
}

TrainStats ObjectField::RunSteps(int steps, int threads) {
  TrainStats stats =
      field_.Run({.ray = [this](uint64_t step, int index) { return rays_.Get(step, index); },
                  .learning_rate = [this](uint64_t step) { return static_cast<float>(plan_.LearningRate(step)); },
                  .progress = [this](uint64_t step) { return static_cast<float>(plan_.Progress(step)); }},
                 steps, threads);
  if (!field_.model().IsFinite()) {
    spdlog::warn("{}: training diverged after {} steps with {} views; restarting", id_.ToString(), field_.steps(),
                 views());
    ++divergences_;
    RestartTraining();
    stats.restarted = true;
  }
  return stats;
}

// Compares the field with all views and adapts poses, trust, ray weights and the training plan to the result.
void ObjectField::Evaluate() {
  if (views_.RefinementIsDue(steps())) RefinePoses();
  if (steps() % kMaskCheckSteps == 0 && views_.MeasureMaskBorder(rays_, field_.model(), field_.Space())) {
    spdlog::info("{}: the borders of the masks are uncertain by {} px; widening the hull", id_.ToString(),
                 views_.quality().mask_border_px);
    RebuildHull();
    views_changed_ = true;
    PrepareViews();
    plan_.OnNewBox(steps(), kLostShare);
  }
  const ProbeReport report = probe_.Measure(field_.model(), config_, field_.Space());
  if (views_.UpdateTrust(report, steps())) {
    RebuildHull();
    plan_.OnNewView(steps());
    loss_trend_.Restart();
  }
  loss_trend_.Record(steps(), report.Loss(views_.Weights()));
  rays_.Weigh(views_.Weights());
  plan_.OnEvaluation(steps(), loss_trend_.DecreasePer100Steps());
}

void ObjectField::RefinePoses() {
  const bool hull_changed = views_.RefinePoses(field_.box(), rays_, field_.model(), field_.Space(), steps());
  rays_.SetCameras(views_.views(), field_.box());
  probe_.Build(rays_, views_.size());
  if (hull_changed) field_.SetHull(views_.CarveHull());
}

void ObjectField::RebuildHull() {
  views_.RebuildHull(field_.box());
  field_.SetHull(views_.CarveHull());
}

void ObjectField::RestartTraining() {
  field_.Restart();
  ResetProgress();
  RebuildHull();
}

// After the field was restarted. The hull must be rebuilt, because all views are trusted again.
void ObjectField::ResetProgress() {
  plan_.Restart();
  views_.ResetTrust();
  loss_trend_.Restart();
  loss_ = 0;
}

bool ObjectField::IsPaused() const { return divergences_ >= kMaxDivergences; }

uint64_t ObjectField::AllowedSteps(bool complete) const {
  return IsPaused() ? 0 : plan_.AllowedSteps(views(), complete);
}

std::string ObjectField::Warning() const {
  std::vector<KeyframeId> untrusted;
  for (size_t i = 0; i < views_.size(); ++i) {
    if (!views_.trusted(i)) untrusted.push_back(views_.views()[i].keyframe);
  }
  return warnings_.Text(IsPaused() ? divergences_ : 0, untrusted);
}

FieldSnapshot ObjectField::Snapshot() const {
  FieldSnapshot snapshot;
  snapshot.object = id_;
  snapshot.steps = steps();
  snapshot.train_seconds = train_seconds_;
  snapshot.loss = loss_;
  snapshot.views = views();
  snapshot.warning = Warning();
  const TrainingBox box = field_.box().Moved(S_new_first_);
  snapshot.S_new_first = S_new_first_;
  snapshot.T_world_object = box.T_world_object;
  snapshot.box_half_extents = box.half_extents.cast<float>();
  DescribeSurface(config_, field_.model(), box, snapshot);
  snapshot.hull = {kOccupancyResolution, field_.TrimmedHull()};
  for (size_t i = 0; i < views_.size(); ++i) {
    if (!views_.trusted(i)) continue;
    const ObjectView& view = views_.views()[i];
    const SE3<Camera, Object> T_camera_object = view.T_world_camera.Inverse() * field_.box().T_world_object;
    snapshot.cameras.push_back({{T_camera_object.rotation(), S_new_first_.scale() * T_camera_object.translation()},
                                view.camera,
                                view.roi_px,
                                view.ray_kind,
                                view.color_bgr});
  }
  snapshot.field = std::make_shared<TrainedField>(field_.model().Clone(), box);
  return snapshot;
}

}  // namespace romap::nerf
