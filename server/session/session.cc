#include "server/session/session.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "common/status.h"

namespace romap::session {
namespace {

int64_t UnixNow_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// Of training after each keyframe when one thread does all; about what two cores do between keyframes.
constexpr int kSlicesPerKeyframe = 4;

// Does the local map that tracking works with change by this frame?
bool ChangesMap(const slam::TrackedImage& image) {
  return !image.pose_given &&
         (image.tracked.is_keyframe || image.initial_views || image.tracked.state == TrackingState::kLost);
}

}  // namespace

Session::Session(std::string id, const SessionOptions& options, const ServerConfig& config, nerf::TrainingPool* pool,
                 Mesher* mesher, std::unique_ptr<wire::RecordingWriter> recorder)
    : id_(std::move(id)),
      options_(options),
      config_(config),
      created_unix_ns_(UnixNow_ns()),
      pool_(pool),
      mesher_(mesher),
      recorder_(std::move(recorder)),
      ingest_(options.camera, config.objects.max_mask_delay_s),
      tracker_(config.slam, options.pose_use, &local_map_),
      sparse_mapper_(config.slam, &local_map_, config.session.single_thread),
      object_mapper_(config.objects),
      next_statistics_(Clock::now()),
      inputs_(config.session.frame_queue),
      tracked_(config.session.mapping_queue) {
  mesher_client_ =
      mesher_->Register([this](MeshUpdate mesh, const MeshPlace& place) { map_.PublishMesh(std::move(mesh), place); });
  pool_client_ =
      pool_->Register([this](FieldSnapshot snapshot) { mesher_->Offer(mesher_client_, std::move(snapshot)); });
  if (config_.session.single_thread) {
    tracking_thread_ = std::thread([this] { RunAll(); });
    return;
  }
  tracking_thread_ = std::thread([this] { RunTracking(); });
  mapping_thread_ = std::thread([this] { RunMapping(); });
}

Session::~Session() {
  Stop(absl::CancelledError("the session was closed"));
  pool_->Unregister(pool_client_);
  mesher_->Unregister(mesher_client_);
}

void Session::Stop(const absl::Status& status) {
  stopping_ = true;
  inputs_.Close();
  tracked_.Close();
  map_.Close(status);
  if (tracking_thread_.joinable()) tracking_thread_.join();
  if (mapping_thread_.joinable()) mapping_thread_.join();
}

// ------------------------------------------------------------------------------------------------ the data path

void Session::RunTracking() {
  try {
    while (std::optional<Arrival> arrival = inputs_.Pop()) {
      if (!stopping_) Take(*arrival);
    }
  } catch (const std::exception& e) {
    Fail("tracking", e.what());
  }
  tracked_.Close();
}

// Tracking, mapping and training in turns.
void Session::RunAll() {
  try {
    while (std::optional<Arrival> arrival = inputs_.Pop()) {
      if (!stopping_) Take(*arrival);
      PublishStatistics();
    }
    EndMapping();
  } catch (const std::exception& e) {
    Fail("mapping", e.what());
    SettleAll();
  }
}

void Session::Take(const Arrival& arrival) {
  std::holds_alternative<FrameInput>(arrival.input) ? TrackFrame(arrival) : TakeMasks(arrival);
}

void Session::TrackFrame(const Arrival& arrival) {
  auto frame = ingest_.Accept(std::get<FrameInput>(arrival.input));
  if (!frame.ok()) return Reject(arrival, Message(frame.status()));
  Record(arrival.input);
  slam::TrackedImage image = tracker_.Track(*frame);
  Acknowledge(arrival, image.tracked);
  if (config_.session.single_thread) {
    MapFrame(image);
    if (image.tracked.is_keyframe) pool_->TrainSlices(pool_client_, kSlicesPerKeyframe);
    return;
  }
  options_.mode == FrameMode::kLive ? QueueLive(std::move(image)) : QueueReplay(std::move(image));
}

// What a detector says is rarer than frames, and dear: it waits for room, as keyframes do.
void Session::TakeMasks(const Arrival& arrival) {
  auto masks = ingest_.AcceptMasks(std::get<MasksInput>(arrival.input));
  if (!masks.ok()) return Reject(arrival, Message(masks.status()));
  Record(arrival.input);
  map_.Acknowledge(MasksAck{.frame_id = masks->frame_id, .accepted = true, .error = ""});
  if (config_.session.single_thread) return MapMasks(*masks);
  tracked_.Push(*std::move(masks));
}

// A live stream does not wait for mapping: an ordinary frame that finds no room is tracked, but says nothing of
// objects.
void Session::QueueLive(slam::TrackedImage image) {
  if (image.tracked.is_keyframe) sparse_mapper_.RequestEarlyStop(++keyframes_waiting_ > 0);
  const bool must_be_mapped = image.tracked.is_keyframe || image.initial_views;
  MappingTask task = std::move(image);
  if (tracked_.TryPush(task)) return;
  if (must_be_mapped) {
    tracked_.Push(std::move(task));
  } else {
    Settle();
  }
}

// A recording can wait: what changes the map is mapped before the next frame is tracked.
void Session::QueueReplay(slam::TrackedImage image) {
  const bool changes_map = ChangesMap(image);
  if (changes_map) CountMapChange(1);
  if (!tracked_.Push(std::move(image)) || !changes_map) return;
  std::unique_lock lock(drain_mutex_);
  map_changed_.wait(lock, [&] { return map_changes_waiting_ == 0 || all_settled_; });
}

void Session::CountMapChange(int change) {
  std::lock_guard lock(drain_mutex_);
  map_changes_waiting_ += change;
  map_changed_.notify_all();
}

void Session::RunMapping() {
  const auto period = std::chrono::milliseconds(static_cast<int64_t>(1000 * config_.session.statistics_period_s));
  try {
    while (!tracked_.Drained()) {
      const std::optional<MappingTask> task = tracked_.PopFor(period);
      if (task) Map(*task);
      PublishStatistics();
    }
    EndMapping();
  } catch (const std::exception& e) {
    Fail("mapping", e.what());
    SettleAll();
  }
}

void Session::EndMapping() {
  SettleAll();
  if (state_ != SessionState::kFailed && !stopping_) TrainToTheEnd();
}

void Session::Map(const MappingTask& task) {
  if (const auto* masks = std::get_if<FrameMasks>(&task)) {
    if (!stopping_) MapMasks(*masks);
    return;
  }
  const slam::TrackedImage& image = std::get<slam::TrackedImage>(task);
  if (options_.mode == FrameMode::kLive && image.tracked.is_keyframe)
    sparse_mapper_.RequestEarlyStop(--keyframes_waiting_ > 0);
  if (!stopping_) MapFrame(image);
  if (ChangesMap(image)) CountMapChange(-1);
}

void Session::MapMasks(const FrameMasks& masks) {
  sparse_mapper_.ObserveMasks(masks);
  Publish(object_mapper_.ObserveLateMasks(masks));
  Settle();
}

void Session::MapFrame(const slam::TrackedImage& image) {
  const slam::MappedFrame mapped = sparse_mapper_.Process(image);
  if (mapped.was_reset) Publish(object_mapper_.Reset());
  if (mapped.correction) Correct(*mapped.correction);
  Publish(object_mapper_.ObserveFrame(mapped.tracked));
  if (mapped.view) {
    Publish(object_mapper_.ObserveKeyframe(*mapped.view));
    ++keyframes_;
  }
  map_points_ = sparse_mapper_.points();
  ++frames_processed_;
  Settle();
}

void Session::Correct(const MapCorrection& correction) {
  map_.Correct(correction);
  Publish(object_mapper_.Correct(correction));
}

void Session::Publish(objects::ObjectOutput output) {
  // Before the updates that tell clients of it, and before the fields make meshes in the corrected world.
  for (const ObjectViews& views : output.views) {
    if (views.S_new_old) map_.MoveObject(views.object, *views.S_new_old);
  }
  for (MapEvent& event : output.events) {
    ObjectId gone;
    if (const auto* removed = std::get_if<ObjectRemoved>(&event)) gone = removed->id;
    if (const auto* merged = std::get_if<ObjectMerged>(&event)) gone = merged->from;
    if (gone) {
      pool_->Remove(pool_client_, gone);
      mesher_->Remove(mesher_client_, gone);
    }
    map_.Apply(std::move(event));
  }
  for (ObjectViews& views : output.views) pool_->Offer(pool_client_, std::move(views));
}

void Session::TrainToTheEnd() {
  Correct(sparse_mapper_.Finish());
  Publish(object_mapper_.Finish());
  pool_->Finish(pool_client_);
  while (!stopping_ && !(pool_->Idle(pool_client_) && mesher_->Idle(mesher_client_))) {
    if (config_.session.single_thread) {
      pool_->TrainSlices(pool_client_, 1);
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    PublishStatistics();
  }
  if (stopping_) return;
  map_.Publish(CurrentStatistics());
  state_ = SessionState::kFinished;
  map_.Close(absl::OkStatus());
}

}  // namespace romap::session
