#include "server/session/session.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include "common/status.h"

namespace romap {
namespace {

uint64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  uint64_t pages_total = 0, pages_resident = 0;
  statm >> pages_total >> pages_resident;
  return pages_resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

int64_t UnixNow_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// Of training after each keyframe when one thread does all; about what two cores do between keyframes.
constexpr int kSlicesPerKeyframe = 4;

// Does the local map that tracking works with change by this frame?
bool ChangesMap(const TrackedImage& image) {
  return !image.pose_given && (image.tracked.is_keyframe || image.start || image.tracked.state == TrackingState::kLost);
}

double Seconds(std::chrono::steady_clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

}  // namespace

Session::Session(std::string id, const SessionOptions& options, const ServerConfig& config, TrainingPool* pool,
                 Mesher* mesher, std::unique_ptr<wire::RecordingWriter> recorder)
    : id_(std::move(id)),
      options_(options),
      config_(config),
      created_unix_ns_(UnixNow_ns()),
      pool_(pool),
      mesher_(mesher),
      recorder_(std::move(recorder)),
      ingest_(options.camera),
      tracker_(config.slam, options.pose_use, &local_map_),
      sparse_mapper_(config.slam, &local_map_, config.session.single_thread),
      object_mapper_(config.objects),
      next_statistics_(Clock::now()),
      frames_(config.session.frame_queue),
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
  frames_.Close();
  tracked_.Close();
  map_.Close(status);
  if (tracking_thread_.joinable()) tracking_thread_.join();
  if (mapping_thread_.joinable()) mapping_thread_.join();
}

// ------------------------------------------------------------------------------------------------ the data path

void Session::RunTracking() {
  try {
    while (std::optional<Arrival> arrival = frames_.Pop()) {
      if (!stopping_) TrackFrame(*arrival);
    }
  } catch (const std::exception& e) {
    Fail("tracking", e.what());
  }
  tracked_.Close();
}

// Tracking, mapping and training in turns.
void Session::RunAll() {
  try {
    while (std::optional<Arrival> arrival = frames_.Pop()) {
      if (!stopping_) TrackFrame(*arrival);
      PublishStatistics();
    }
    EndMapping();
  } catch (const std::exception& e) {
    Fail("mapping", e.what());
    SettleAll();
  }
}

void Session::TrackFrame(const Arrival& arrival) {
  const FrameInput& input = arrival.input;
  auto frame = ingest_.Accept(input);
  if (!frame.ok()) return Reject(input, Message(frame.status()), arrival.time);
  Record(input);
  TrackedImage image = tracker_.Track(*frame);
  Acknowledge(arrival, image.tracked);
  if (config_.session.single_thread) {
    MapFrame(image);
    if (image.tracked.is_keyframe) pool_->TrainSlices(pool_client_, kSlicesPerKeyframe);
    return;
  }
  options_.mode == FrameMode::kLive ? QueueLive(std::move(image)) : QueueReplay(std::move(image));
}

// A live stream does not wait for mapping: an ordinary frame that finds no room is tracked, but says nothing of
// objects.
void Session::QueueLive(TrackedImage image) {
  if (image.tracked.is_keyframe) sparse_mapper_.Hurry(++keyframes_waiting_ > 0);
  if (tracked_.TryPush(image)) return;
  if (image.tracked.is_keyframe || image.start) {
    tracked_.Push(std::move(image));
  } else {
    Settle();
  }
}

// A recording can wait: what changes the map is mapped before the next frame is tracked.
void Session::QueueReplay(TrackedImage image) {
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

void Session::Acknowledge(const Arrival& arrival, const TrackedFrame& tracked) {
  const bool has_pose = tracked.state == TrackingState::kTracking || tracked.state == TrackingState::kRelocalised;
  FrameAck ack;
  ack.frame_id = arrival.input.frame_id;
  ack.state = tracked.state;
  if (has_pose) ack.T_world_camera = tracked.T_world_camera;
  ack.is_keyframe = tracked.is_keyframe;
  ack.latency_s = Seconds(Clock::now() - arrival.time);
  ack.state_reason = tracked.reason;
  map_.Acknowledge(std::move(ack), arrival.input.timestamp_ns, tracked.reference, tracked.T_reference_camera);
}

void Session::RunMapping() {
  const auto period = std::chrono::milliseconds(static_cast<int64_t>(1000 * config_.session.statistics_period_s));
  try {
    while (!tracked_.Drained()) {
      const std::optional<TrackedImage> image = tracked_.PopFor(period);
      if (image && options_.mode == FrameMode::kLive && image->tracked.is_keyframe) {
        sparse_mapper_.Hurry(--keyframes_waiting_ > 0);
      }
      if (image && !stopping_) MapFrame(*image);
      if (image && ChangesMap(*image)) CountMapChange(-1);
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

void Session::MapFrame(const TrackedImage& image) {
  const MappedFrame mapped = sparse_mapper_.Process(image);
  if (mapped.begun_anew) Publish(object_mapper_.Reset());
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

void Session::Publish(ObjectMapper::Output output) {
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

// ------------------------------------------------------------------------------------------------ bookkeeping

void Session::Reject(const FrameInput& input, const std::string& why, Clock::time_point arrival) {
  ++frames_rejected_;
  spdlog::info("session {}: frame {} not accepted: {}", id_, input.frame_id, why);
  map_.Acknowledge({.frame_id = input.frame_id,
                    .accepted = false,
                    .error = why,
                    .state = TrackingState::kLost,
                    .T_world_camera = std::nullopt,
                    .is_keyframe = false,
                    .latency_s = Seconds(Clock::now() - arrival)},
                   input.timestamp_ns);
  Settle();
}

// A disk that fails costs the recording, not the session.
void Session::Record(const FrameInput& input) {
  if (!recorder_) return;
  const absl::Status status = recorder_->Append(input);
  if (status.ok()) return;
  spdlog::error("session {}: its recording ends: {}", id_, Message(status));
  recorder_ = nullptr;
}

void Session::Fail(const char* stage, const std::string& what) {
  spdlog::error("session {}: {} failed, the session ends: {}", id_, stage, what);
  state_ = SessionState::kFailed;
  frames_.Close();
  tracked_.Close();
  map_.Close(Internal("session {}: {} failed: {}", id_, stage, what));
}

absl::Status Session::Offer(FrameInput input) {
  const auto closed = [&] { return FailedPrecondition("session {} takes no more frames: it is finished", id_); };
  Arrival arrival{std::move(input), Clock::now()};
  if (options_.mode == FrameMode::kReplay) {
    if (!frames_.Push(std::move(arrival))) return closed();
    ++frames_received_;
    return absl::OkStatus();
  }
  bool accepted = false;
  const std::optional<Arrival> dropped = frames_.PushDroppingOldest(std::move(arrival), &accepted);
  if (!accepted) return closed();
  ++frames_received_;
  if (dropped) {
    ++frames_dropped_;
    map_.Acknowledge({.frame_id = dropped->input.frame_id,
                      .accepted = false,
                      .error = "dropped: the server is behind the live stream",
                      .state = TrackingState::kTracking,
                      .T_world_camera = std::nullopt,
                      .is_keyframe = false,
                      .latency_s = Seconds(Clock::now() - dropped->time)},
                     dropped->input.timestamp_ns);
    Settle();
  }
  return absl::OkStatus();
}

void Session::Finish() {
  SessionState open = SessionState::kOpen;
  state_.compare_exchange_strong(open, SessionState::kFinishing);
  frames_.Close();
}

bool Session::AttachSender() { return !sender_attached_.exchange(true); }
void Session::DetachSender() { sender_attached_ = false; }

void Session::WhenDrained(std::function<void()> done) {
  {
    std::lock_guard lock(drain_mutex_);
    const uint64_t target = frames_received_;
    if (!all_settled_ && frames_settled_ < target) {
      drain_waiters_.emplace(target, std::move(done));
      return;
    }
  }
  done();
}

void Session::Settle() {
  std::vector<std::function<void()>> due;
  {
    std::lock_guard lock(drain_mutex_);
    ++frames_settled_;
    const auto end = drain_waiters_.upper_bound(frames_settled_);
    for (auto it = drain_waiters_.begin(); it != end; ++it) due.push_back(std::move(it->second));
    drain_waiters_.erase(drain_waiters_.begin(), end);
  }
  for (const auto& done : due) done();
}

void Session::SettleAll() {
  std::multimap<uint64_t, std::function<void()>> due;
  {
    std::lock_guard lock(drain_mutex_);
    all_settled_ = true;
    map_changed_.notify_all();
    due.swap(drain_waiters_);
  }
  for (const auto& [target, done] : due) done();
}

void Session::PublishStatistics() {
  const Clock::time_point now = Clock::now();
  if (now < next_statistics_) return;
  next_statistics_ = now + std::chrono::duration_cast<Clock::duration>(
                               std::chrono::duration<double>(config_.session.statistics_period_s));
  map_.Publish(CurrentStatistics());
}

Statistics Session::CurrentStatistics() const {
  const TrainingPool::Progress progress = pool_->GetProgress(pool_client_);
  Statistics statistics;
  statistics.frames_received = frames_received_;
  statistics.frames_processed = frames_processed_;
  statistics.frames_dropped = frames_dropped_;
  statistics.frames_rejected = frames_rejected_;
  statistics.keyframes = keyframes_;
  statistics.map_points = map_points_;
  statistics.objects = map_.ConfirmedObjects();
  statistics.objects_training = static_cast<uint64_t>(std::max(0, progress.objects_training));
  statistics.training_steps = progress.steps;
  statistics.training_progress = progress.progress;
  statistics.resident_bytes = ResidentBytes();
  return statistics;
}

SessionInfo Session::Info() const {
  SessionInfo info;
  info.id = id_;
  info.name = options_.name;
  info.camera = options_.camera;
  info.mode = options_.mode;
  info.state = state_;
  info.created_unix_ns = created_unix_ns_;
  info.stream_open = sender_attached_;
  info.statistics = CurrentStatistics();
  return info;
}

MapSnapshot Session::Export() const {
  MapSnapshot snapshot = map_.Snapshot();
  snapshot.session_id = id_;
  snapshot.state = state_;
  snapshot.statistics = CurrentStatistics();
  return snapshot;
}

}  // namespace romap
