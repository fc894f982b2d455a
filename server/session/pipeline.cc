#include "server/session/pipeline.h"

#include <spdlog/spdlog.h>

#include <utility>
#include <variant>

#include "common/status.h"

namespace romap::session {
namespace {

slam::SparseMapper::Background BackgroundWork(FrameMode mode, const SessionConfig& config) {
  using Background = slam::SparseMapper::Background;
  if (config.single_thread) return Background::kNothing;
  return mode == FrameMode::kLive ? Background::kAllAdjustment : Background::kGlobalAdjustment;
}

}  // namespace

// ---------------------------------------------------------------------------------------------------- the data path

CheckedInput Pipeline::Check(Arrival arrival) {
  CheckedInput checked{.arrival = std::move(arrival), .content = absl::OkStatus()};
  const SessionInput& input = checked.arrival.input;
  const auto set_content = [&](auto result) {
    if (!result.ok()) {
      checked.content = result.status();
      return;
    }
    checked.content = *std::move(result);
    if (on_accepted_) on_accepted_(input);
  };
  try {
    if (ingest_.IsDuplicate(input)) {
      checked.content = DuplicateInput{};
    } else if (const auto* frame = std::get_if<FrameInput>(&input)) {
      set_content(ingest_.Accept(*frame));
    } else {
      set_content(ingest_.AcceptMasks(std::get<MasksInput>(input)));
    }
  } catch (const std::exception& e) {
    // A decoder failed. Ingest changes its state only after everything is decoded, so only this input is lost.
    checked.content = Internal("cannot be decoded: {}", e.what());
  }
  diagnostics_->SetConditions("ingest", ingest_.Diagnostics());
  return checked;
}

void Pipeline::Process(const CheckedInput& input, const MappingExecutor& execute) {
  if (const auto* error = std::get_if<absl::Status>(&input.content)) {
    Reject(input.arrival, *error);
  } else if (const auto* frame = std::get_if<std::shared_ptr<const Frame>>(&input.content)) {
    ProcessFrame(input.arrival, *frame, execute);
  } else if (std::holds_alternative<DuplicateInput>(input.content)) {
    ledger_->AcknowledgeDuplicate(input.arrival);
  } else {
    ProcessLateMasks(std::get<FrameMasks>(input.content), execute);
  }
}

void Pipeline::Reject(const Arrival& arrival, const absl::Status& reason) {
  ledger_->Reject(arrival, reason);
  if (const auto* frame = std::get_if<FrameInput>(&arrival.input)) {
    rejections_.AddFrame(frame->frame_id, reason);
  } else {
    rejections_.AddMasks(std::get<MasksInput>(arrival.input).frame_id, reason);
  }
  diagnostics_->SetConditions("input", rejections_.Diagnostics());
}

void Pipeline::ProcessFrame(const Arrival& arrival, const std::shared_ptr<const Frame>& frame,
                            const MappingExecutor& execute) {
  // Track.
  std::optional<slam::TrackedImage> tracked_image = Track(arrival, frame);
  if (!tracked_image) return;
  slam::TrackedImage& image = *tracked_image;
  ledger_->AcknowledgeFrame(arrival, image.tracked);
  live_view_.SetImage(frame);
  rejections_.CountAcceptedFrame();
  diagnostics_->SetConditions("input", rejections_.Diagnostics());
  const bool is_lost = image.tracked.state == TrackingState::kLost;
  MappingStep step;
  step.is_keyframe = image.tracked.is_keyframe;
  step.may_be_skipped = !image.tracked.is_keyframe && !image.initial_views;
  step.relocalizes = is_lost && !image.initial_views && image.features;
  step.changes_local_map = !image.pose_given && (image.tracked.is_keyframe || image.initial_views || is_lost);

  step.run = [this, image = std::move(image)] {
    // Map.
    const slam::MappedFrame mapped = sparse_mapper_.Process(image);
    points_changed_ |= mapped.correction || mapped.view;
    if (mapped.correction) Correct(*mapped.correction);
    // Objects. Publish() sends them to the clients, and their new views to the fields.
    Publish(object_mapper_.ObserveFrame(mapped.tracked));
    if (mapped.view) {
      const KeyframeView& view = *mapped.view;
      map_->SetKeyframe(view.frame->frame_id, view.frame->timestamp_ns, view.id, view.T_world_camera);
      Publish(object_mapper_.ObserveKeyframe(view));
    }
    diagnostics_->SetConditions("slam", sparse_mapper_.Diagnostics());
    ledger_->CountMappedFrame(mapped.view.has_value(), sparse_mapper_.points());
  };
  execute(std::move(step));
}

// A library that fails on one image costs this image: the tracker keeps its last frame and finds the camera again from
// there. If it fails on all images, the session ends.
std::optional<slam::TrackedImage> Pipeline::Track(const Arrival& arrival, const std::shared_ptr<const Frame>& frame) {
  absl::StatusOr<slam::TrackedImage> image = tracker_guard_.Run([&] { return tracker_.Track(frame); });
  if (image.ok()) return *std::move(image);
  Reject(arrival, Internal("cannot be tracked: {}", Message(image.status())));
  return std::nullopt;
}

// Late masks take the same path, so that every stage has processed the frame before its masks.
void Pipeline::ProcessLateMasks(const FrameMasks& masks, const MappingExecutor& execute) {
  ledger_->AcknowledgeMasks(masks);

  MappingStep step;
  step.run = [this, converted = tracker_.ConvertMasks(masks)] {
    sparse_mapper_.ObserveMasks(converted);
    Publish(object_mapper_.ObserveLateMasks(converted));
    ledger_->CountMappedMasks();
  };
  execute(std::move(step));
}

void Pipeline::Correct(const MapCorrection& correction) {
  map_->Correct(correction);
  Publish(object_mapper_.Correct(correction));
}

// Objects -> clients and fields.
void Pipeline::Publish(objects::ObjectOutput output) {
  // This comes first, because the object updates below publish the corrected mesh poses, and because a field must not
  // produce meshes in the corrected world before the map is corrected.
  for (const ObjectViews& views : output.views) {
    if (views.S_new_old) map_->MoveObject(views.object, *views.S_new_old);
  }
  for (MapEvent& event : output.events) PublishEvent(std::move(event));
  for (ObjectViews& views : output.views) pool_->Offer(pool_session_, std::move(views));
}

void Pipeline::PublishEvent(MapEvent event) {
  ObjectId ended;
  if (const auto* removed = std::get_if<ObjectRemoved>(&event)) ended = removed->id;
  if (const auto* merged = std::get_if<ObjectMerged>(&event)) ended = merged->from;
  if (ended) {
    pool_->RemoveObject(pool_session_, ended);
    mesher_->RemoveObject(mesher_session_, ended);
  }
  map_->Apply(std::move(event));
}

// Fields -> meshes. Called by the training pool.
void Pipeline::MeshField(FieldSnapshot snapshot) { mesher_->Offer(mesher_session_, std::move(snapshot)); }

// Meshes -> clients. Called by the mesher.
void Pipeline::PublishMesh(MeshUpdate mesh, const MeshPose& pose) { map_->PublishMesh(std::move(mesh), pose); }

void Pipeline::PublishPoints() {
  if (!std::exchange(points_changed_, false)) return;
  live_view_.SetPoints({.map_id = sparse_mapper_.current_map(),
                        .positions_world = sparse_mapper_.CurrentPoints(MappingService::kMaxSparsePoints)});
}

void Pipeline::FinishMapping() {
  Correct(sparse_mapper_.Finish());
  points_changed_ = true;
  diagnostics_->SetConditions("slam", sparse_mapper_.Diagnostics());
  Publish(object_mapper_.Finish());
  diagnostics_->SetConditions("objects", object_mapper_.Diagnostics());
  pool_->Finish(pool_session_);
}

// -------------------------------------------------------------------------------------------------------------------

Pipeline::Pipeline(const SessionOptions& options, const ServerConfig& config, nerf::TrainingPool* pool, Mesher* mesher,
                   MapState* map, FrameLedger* ledger, DiagnosticLog* diagnostics, InputSink on_accepted)
    : pool_(pool),
      mesher_(mesher),
      map_(map),
      ledger_(ledger),
      diagnostics_(diagnostics),
      ingest_(options.camera, config.objects.max_mask_delay_s, stop_.get_token()),
      on_accepted_(std::move(on_accepted)),
      tracker_(config.slam, options.pose_use, &local_map_),
      sparse_mapper_(config.slam, &local_map_, BackgroundWork(options.mode, config.session),
                     {.direction_world = options.up_world, .estimate = options.estimate_up}),
      object_mapper_(config.objects) {
  mesher_session_ = mesher_->AddSession(
      [this](MeshUpdate mesh, const MeshPose& pose) { PublishMesh(std::move(mesh), pose); }, ledger_->session_id());
  try {
    pool_session_ = pool_->AddSession([this](FieldSnapshot snapshot) { MeshField(std::move(snapshot)); },
                                      {.session_id = ledger_->session_id(), .tenant = options.tenant});
  } catch (...) {
    mesher_->RemoveSession(mesher_session_);
    throw;
  }
}

Pipeline::~Pipeline() {
  pool_->RemoveSession(pool_session_);
  mesher_->RemoveSession(mesher_session_);
}

bool Pipeline::IsTrainingDone() const { return pool_->IsIdle(pool_session_) && mesher_->IsIdle(mesher_session_); }

void Pipeline::TrainSlices(int count) { pool_->TrainSlices(pool_session_, count); }

}  // namespace romap::session
