#include "tests/support/fake_mapping_service.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <set>
#include <utility>

#include "common/status.h"

namespace romap::testing_support {

// The event queue of one subscriber.
class Mailbox {
 public:
  void Put(MapEvent event) {
    std::lock_guard lock(mutex_);
    if (closed_) return;
    events_.push_back(std::move(event));
    changed_.notify_all();
  }
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, timeout, [&] { return closed_ || !events_.empty(); });
    if (events_.empty()) return std::nullopt;
    std::optional<MapEvent> event(std::move(events_.front()));
    events_.pop_front();
    return event;
  }
  void Close(const absl::Status& status) {
    std::lock_guard lock(mutex_);
    if (closed_) return;
    closed_ = true;
    status_ = status;
    changed_.notify_all();
  }
  bool Done() {
    std::lock_guard lock(mutex_);
    return closed_ && events_.empty();
  }
  absl::Status status() {
    std::lock_guard lock(mutex_);
    return status_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<MapEvent> events_;
  bool closed_ = false;
  absl::Status status_;
};

namespace {

MeshUpdate MeshOf(const ObjectUpdate& object) {
  MeshUpdate mesh;
  mesh.id = object.id;
  mesh.revision = object.revision;
  mesh.steps = 100 * object.observations;
  mesh.vertex_count = 3;
  mesh.triangle_count = 1;
  mesh.draco = "mesh of " + object.class_name;
  return mesh;
}

}  // namespace

class FakeSession {
 public:
  FakeSession(SessionInfo info) : info_(std::move(info)) {}

  SessionInfo Info() {
    std::lock_guard lock(mutex_);
    return info_;
  }

  // The mailbox starts with all current objects.
  std::shared_ptr<Mailbox> Subscribe() {
    std::lock_guard lock(mutex_);
    return SubscribeLocked();
  }

  absl::StatusOr<std::shared_ptr<Mailbox>> AttachSender(const std::string& resume_token) {
    std::lock_guard lock(mutex_);
    if (info_.state != SessionState::kOpen)
      return FailedPrecondition("session '{}' was finished and accepts no more frames", info_.id);
    if (sender_) {
      if (resume_token != ResumeToken())
        return FailedPrecondition("session '{}' already has a Map stream; close it first", info_.id);
      sender_->Close(absl::AbortedError("the client continues the session on another stream"));
    }
    info_.stream_open = true;
    sender_ = SubscribeLocked();
    return sender_;
  }
  void DetachSender(const std::shared_ptr<Mailbox>& mailbox) {
    std::lock_guard lock(mutex_);
    if (sender_ != mailbox) return;
    sender_ = nullptr;
    info_.stream_open = false;
  }
  bool IsSender(const std::shared_ptr<Mailbox>& mailbox) {
    std::lock_guard lock(mutex_);
    return sender_ == mailbox;
  }
  StreamOpening Opening(bool sender) {
    std::lock_guard lock(mutex_);
    StreamOpening opening;
    if (sender) opening.resume_token = ResumeToken();
    for (const auto& [name, object] : objects_) opening.objects.push_back(object.id);
    if (newest_frame_id_ > 0) opening.newest_frame_id = newest_frame_id_;
    return opening;
  }
  void Unsubscribe(const std::shared_ptr<Mailbox>& mailbox) {
    std::lock_guard lock(mutex_);
    subscribers_.erase(mailbox);
  }

  void PublishDurable(const Durable& durable) {
    std::lock_guard lock(mutex_);
    Publish(durable);
  }
  void Break(const absl::Status& status) {
    std::lock_guard lock(mutex_);
    for (const auto& subscriber : subscribers_) subscriber->Close(status);
    subscribers_.clear();
    sender_ = nullptr;
    info_.stream_open = false;
  }
  void Forget(uint64_t newest_frame_id) {
    std::lock_guard lock(mutex_);
    newest_frame_id_ = newest_frame_id;
    objects_.clear();
    while (!trajectory_.empty() && trajectory_.back().frame_id > newest_frame_id) {
      trajectory_.pop_back();
      timestamps_ns_.pop_back();
    }
  }

  absl::Status Process(const FrameInput& frame) {
    std::lock_guard lock(mutex_);
    if (info_.state != SessionState::kOpen)
      return FailedPrecondition("session '{}' was finished and accepts no more frames", info_.id);
    if (frame.resent && frame.frame_id <= newest_frame_id_) {
      Publish(FrameAck{.frame_id = frame.frame_id, .error = "", .T_world_camera = {}, .duplicate = true});
      return absl::OkStatus();
    }
    Statistics& statistics = info_.statistics;
    ++statistics.frames_received;
    FrameAck ack{.frame_id = frame.frame_id,
                 .accepted = !frame.image.empty(),
                 .error = frame.image.empty() ? "frame.image.data: missing" : "",
                 .state = TrackingState::kTracking,
                 .T_world_camera = frame.T_world_camera,
                 .is_keyframe = false,
                 .latency_s = 0};
    ++(ack.accepted ? statistics.frames_processed : statistics.frames_rejected);
    Publish(ack);
    if (!ack.accepted) return absl::OkStatus();
    newest_frame_id_ = std::max(newest_frame_id_, frame.frame_id);
    if (frame.mask_encoding == MaskEncoding::kNone) awaiting_masks_.insert(frame.frame_id);
    trajectory_.push_back(ack);
    timestamps_ns_.push_back(frame.timestamp_ns);
    for (const Instance& instance : frame.instances) AddObservation(instance);
    return absl::OkStatus();
  }

  absl::Status ProcessMasks(const MasksInput& masks) {
    std::lock_guard lock(mutex_);
    if (info_.state != SessionState::kOpen)
      return FailedPrecondition("session '{}' was finished and accepts no more frames", info_.id);
    if (masks.resent && with_late_masks_.contains(masks.frame_id)) {
      Publish(MasksAck{.frame_id = masks.frame_id, .duplicate = true});
      return absl::OkStatus();
    }
    const bool awaited = awaiting_masks_.erase(masks.frame_id) > 0;
    if (awaited) with_late_masks_.insert(masks.frame_id);
    Publish(MasksAck{.frame_id = masks.frame_id,
                     .accepted = awaited,
                     .error = awaited ? "" : "frame_id: no accepted frame without masks has this id"});
    if (!awaited) return absl::OkStatus();
    for (const Instance& instance : masks.instances) AddObservation(instance);
    return absl::OkStatus();
  }

  SessionInfo Finish() {
    std::lock_guard lock(mutex_);
    if (info_.state == SessionState::kOpen) Close(absl::OkStatus());
    return info_;
  }
  void Delete() {
    std::lock_guard lock(mutex_);
    Close(NotFound("session '{}' was deleted", info_.id));
  }

  MapSnapshot Export() {
    std::lock_guard lock(mutex_);
    MapSnapshot snapshot;
    snapshot.session_id = info_.id;
    snapshot.state = info_.state;
    for (const auto& [name, object] : objects_) snapshot.objects.push_back({object, MeshOf(object)});
    std::sort(snapshot.objects.begin(), snapshot.objects.end(),
              [](const auto& a, const auto& b) { return a.object.id < b.object.id; });
    snapshot.trajectory = trajectory_;
    snapshot.timestamps_ns = timestamps_ns_;
    snapshot.statistics = info_.statistics;
    return snapshot;
  }

 private:
  std::string ResumeToken() const { return "token of " + info_.id; }

  std::shared_ptr<Mailbox> SubscribeLocked() {
    auto mailbox = std::make_shared<Mailbox>();
    for (const auto& [name, object] : objects_) {
      mailbox->Put(object);
      mailbox->Put(MeshOf(object));
    }
    if (info_.state == SessionState::kFinished) mailbox->Close(absl::OkStatus());
    subscribers_.insert(mailbox);
    return mailbox;
  }

  void Publish(const MapEvent& event) {
    for (const auto& subscriber : subscribers_) subscriber->Put(event);
  }

  void AddObservation(const Instance& instance) {
    const auto [it, is_new] = objects_.try_emplace(instance.class_name);
    ObjectUpdate& object = it->second;
    if (is_new) {
      object.id = ObjectId{objects_.size()};
      object.state = ObjectState::kConfirmed;
      object.class_name = instance.class_name;
      object.class_score = 1;
      object.cuboid.half_extents = Eigen::Vector3d(0.1, 0.2, 0.3);
      object.cuboid.confidence = 0.5;
      object.T_world_mesh.emplace();
      info_.statistics.objects = objects_.size();
    }
    ++object.observations;
    ++object.revision;
    Publish(object);
    Publish(MeshOf(object));
  }

  void Close(const absl::Status& status) {
    info_.state = SessionState::kFinished;
    for (const auto& subscriber : subscribers_) subscriber->Close(status);
  }

  std::mutex mutex_;
  SessionInfo info_;
  std::set<std::shared_ptr<Mailbox>> subscribers_;
  std::shared_ptr<Mailbox> sender_;              // of the stream that may send; null: none
  uint64_t newest_frame_id_ = 0;                 // of the accepted frames
  std::map<std::string, ObjectUpdate> objects_;  // by class name
  std::set<uint64_t> awaiting_masks_;            // accepted frames without masks
  std::set<uint64_t> with_late_masks_;           // accepted frames that got them later
  std::vector<FrameAck> trajectory_;
  std::vector<int64_t> timestamps_ns_;
};

namespace {

using FrameHook = std::function<void(const FrameInput&)>;

class FakeStream : public MapStream {
 public:
  FakeStream(std::shared_ptr<FakeSession> session, std::shared_ptr<Mailbox> mailbox, bool sender, FrameHook hook,
             bool durable = false)
      : session_(std::move(session)),
        mailbox_(std::move(mailbox)),
        hook_(std::move(hook)),
        opening_(session_->Opening(sender)),
        sending_(sender) {
    opening_.durable = durable;
  }
  ~FakeStream() override { Cancel(); }

  const StreamOpening& opening() const override { return opening_; }

  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) override { return mailbox_->Next(timeout); }
  bool Done() const override { return mailbox_->Done(); }
  absl::Status status() const override { return mailbox_->status(); }

  absl::Status Send(FrameInput frame) override {
    ROMAP_RETURN_IF_ERROR(CheckSending());
    hook_(frame);
    return session_->Process(frame);
  }
  absl::Status SendMasks(MasksInput masks) override {
    ROMAP_RETURN_IF_ERROR(CheckSending());
    return session_->ProcessMasks(masks);
  }
  absl::Status CloseSend() override {
    if (!StopSending())
      return FailedPrecondition("sending has ended on this stream: CloseSend() or Cancel() was called");
    mailbox_->Close(absl::OkStatus());
    return absl::OkStatus();
  }
  void Cancel() override {
    StopSending();
    session_->Unsubscribe(mailbox_);
    mailbox_->Close(absl::CancelledError("the stream was canceled"));
  }

 private:
  absl::Status CheckSending() const {
    if (sending_ && session_->IsSender(mailbox_)) return absl::OkStatus();
    return FailedPrecondition("sending has ended on this stream: CloseSend() or Cancel() was called");
  }
  bool StopSending() {
    if (!sending_.exchange(false)) return false;
    session_->DetachSender(mailbox_);
    return true;
  }

  const std::shared_ptr<FakeSession> session_;
  const std::shared_ptr<Mailbox> mailbox_;
  const FrameHook hook_;
  StreamOpening opening_;
  std::atomic<bool> sending_;
};

}  // namespace

FakeMappingService::FakeMappingService() = default;
FakeMappingService::~FakeMappingService() = default;

absl::StatusOr<SessionInfo> FakeMappingService::CreateSession(const SessionOptions& options) {
  ROMAP_RETURN_IF_ERROR(ValidateCameraModel(options.camera));
  std::lock_guard lock(mutex_);
  SessionInfo info;
  info.id = fmt::format("fake-{}", ++sessions_created_);
  info.name = options.name;
  info.tenant = options.tenant;
  info.camera = options.camera;
  info.mode = options.mode;
  info.created_unix_ns = static_cast<int64_t>(sessions_created_);
  sessions_[info.id] = std::make_shared<FakeSession>(info);
  return info;
}

absl::StatusOr<std::vector<SessionInfo>> FakeMappingService::ListSessions() {
  std::lock_guard lock(mutex_);
  std::vector<SessionInfo> infos;
  for (const auto& [id, session] : sessions_) infos.push_back(session->Info());
  return infos;
}

absl::StatusOr<SessionInfo> FakeMappingService::GetSession(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  return session->Info();
}

absl::StatusOr<SessionInfo> FakeMappingService::FinishSession(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  return session->Finish();
}

absl::Status FakeMappingService::DeleteSession(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  {
    std::lock_guard lock(mutex_);
    sessions_.erase(session_id);
  }
  session->Delete();
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<MapStream>> FakeMappingService::OpenMap(const std::string& session_id,
                                                                       const std::string& resume_token) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  {
    std::lock_guard lock(mutex_);
    if (!refusal_.ok()) return refusal_;
  }
  ROMAP_ASSIGN_OR_RETURN(auto mailbox, session->AttachSender(resume_token));
  return std::make_unique<FakeStream>(session, std::move(mailbox), /*sender=*/true, frame_hook_, durable_);
}

void FakeMappingService::PublishDurable(const std::string& session_id, const Durable& durable) {
  if (const auto session = Find(session_id); session.ok()) (*session)->PublishDurable(durable);
}

void FakeMappingService::RefuseStreams(const absl::Status& status) {
  std::lock_guard lock(mutex_);
  refusal_ = status;
}

void FakeMappingService::BreakStreams(const absl::Status& status) {
  std::lock_guard lock(mutex_);
  for (const auto& [id, session] : sessions_) session->Break(status);
}

void FakeMappingService::Crash(uint64_t newest_frame_id) {
  std::lock_guard lock(mutex_);
  for (const auto& [id, session] : sessions_) {
    session->Break(absl::UnavailableError("the server crashed"));
    session->Forget(newest_frame_id);
  }
}

absl::StatusOr<std::unique_ptr<EventStream>> FakeMappingService::Watch(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  return std::make_unique<FakeStream>(session, session->Subscribe(), /*sender=*/false, frame_hook_);
}

absl::StatusOr<MapSnapshot> FakeMappingService::ExportMap(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  return session->Export();
}

namespace {

absl::Status StoresNothing() { return FailedPrecondition("this service stores no sessions"); }

}  // namespace

absl::Status FakeMappingService::SaveSession(const std::string& session_id, const PieceWriter& /*write*/) {
  ROMAP_RETURN_IF_ERROR(Find(session_id).status());
  return StoresNothing();
}

absl::StatusOr<SessionInfo> FakeMappingService::LoadSession(const PieceReader& /*read*/,
                                                            const std::string& /*tenant*/) {
  return StoresNothing();
}

absl::StatusOr<SessionInfo> FakeMappingService::PinSession(const std::string& session_id, bool /*pinned*/) {
  ROMAP_RETURN_IF_ERROR(Find(session_id).status());
  return StoresNothing();
}

absl::StatusOr<std::shared_ptr<FakeSession>> FakeMappingService::Find(const std::string& session_id) {
  std::lock_guard lock(mutex_);
  const auto it = sessions_.find(session_id);
  if (it == sessions_.end()) return NotFound("session '{}' does not exist", session_id);
  return it->second;
}

}  // namespace romap::testing_support
