#include "server/session/local_mapping_service.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <thread>
#include <utility>

#include "common/status.h"
#include "common/wire/recording.h"

namespace romap::session {
namespace {

constexpr size_t kMaxNameLength = 200;

int TrainingThreads(const ServerConfig& config) {
  if (config.session.single_thread) return 0;
  if (config.training_threads > 0) return config.training_threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

class LocalEventStream : public MapStream {
 public:
  // `holder`: null for a stream that only watches.
  LocalEventStream(std::shared_ptr<Session> session, std::shared_ptr<Outbox> outbox, StreamOpening opening,
                   std::shared_ptr<SenderClaim::Holder> holder)
      : session_(std::move(session)),
        outbox_(std::move(outbox)),
        opening_(std::move(opening)),
        holder_(std::move(holder)),
        sending_(holder_ != nullptr) {}

  ~LocalEventStream() override { Cancel(); }

  const StreamOpening& opening() const override { return opening_; }
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) override { return outbox_->Next(timeout); }
  bool Done() const override { return outbox_->Done(); }
  absl::Status status() const override { return outbox_->status(); }

  absl::Status Send(FrameInput frame) override { return Offer(std::move(frame)); }
  absl::Status SendMasks(MasksInput masks) override { return Offer(std::move(masks)); }

  absl::Status CloseSend() override {
    if (!StopSending()) return SendingEnded();
    session_->WhenSettled([outbox = outbox_] { outbox->Close(); });
    return absl::OkStatus();
  }

  void Cancel() override {
    StopSending();
    session_->map().Unsubscribe(outbox_);
    outbox_->Close(absl::CancelledError("the stream was canceled"));
  }

 private:
  absl::Status Offer(SessionInput input) {
    if (!sending_) return SendingEnded();
    absl::Status status;
    if (holder_->Run([&] { status = session_->Offer(std::move(input)); })) return status;
    return outbox_->status().ok() ? SendingEnded() : outbox_->status();
  }

  static absl::Status SendingEnded() {
    return FailedPrecondition("sending has ended on this stream: CloseSend() or Cancel() was called");
  }

  bool StopSending() {
    if (!sending_.exchange(false)) return false;
    session_->sender().Release(holder_);
    return true;
  }

  const std::shared_ptr<Session> session_;
  const std::shared_ptr<Outbox> outbox_;
  const StreamOpening opening_;
  const std::shared_ptr<SenderClaim::Holder> holder_;
  std::atomic<bool> sending_;
};

}  // namespace

LocalMappingService::LocalMappingService(const ServerConfig& config)
    : config_(config),
      pool_(config.nerf, TrainingThreads(config)),
      mesher_(config.mesh, config.session.single_thread ? Mesher::Threading::kCaller : Mesher::Threading::kOwnThread) {}

LocalMappingService::~LocalMappingService() {
  // Sessions use the pool and the mesher, so they must end first.
  std::lock_guard lock(mutex_);
  for (const auto& [id, session] : sessions_) session->Stop(absl::UnavailableError("the server is shutting down"));
  sessions_.clear();
}

std::string LocalMappingService::NewId() {
  std::string id;
  do {
    id = fmt::format("{:012x}", random_() >> 16);
  } while (sessions_.contains(id));
  return id;
}

absl::StatusOr<SessionInfo> LocalMappingService::CreateSession(const SessionOptions& options) {
  ROMAP_RETURN_IF_ERROR(ValidateCameraModel(options.camera));
  if (options.up_world && !(options.up_world->norm() > 0 && options.up_world->allFinite())) {
    return InvalidArgument("up_world: must be finite and not zero");
  }
  if (options.name.size() > kMaxNameLength) {
    return InvalidArgument("name: must have at most {} bytes, has {}", kMaxNameLength, options.name.size());
  }
  std::lock_guard lock(mutex_);
  if (sessions_.size() >= static_cast<size_t>(config_.session.max_sessions)) {
    return absl::ResourceExhaustedError(
        fmt::format("the limit of {} sessions (session.max_sessions) is reached; delete a session first",
                    config_.session.max_sessions));
  }
  const std::string id = NewId();
  std::unique_ptr<wire::RecordingWriter> recorder;
  if (!config_.session.record_dir.empty()) {
    const std::filesystem::path path = std::filesystem::path(config_.session.record_dir) / (id + ".romaprec");
    ROMAP_ASSIGN_OR_RETURN(recorder, wire::RecordingWriter::Create(path.string(), options));
  }
  auto session = std::make_shared<Session>(id, options, config_, &pool_, &mesher_, std::move(recorder));
  sessions_[id] = session;
  spdlog::info("session {}: created, {}x{} px", id, options.camera.width_px, options.camera.height_px);
  return session->Info();
}

absl::StatusOr<std::shared_ptr<Session>> LocalMappingService::Find(const std::string& session_id) const {
  std::lock_guard lock(mutex_);
  const auto it = sessions_.find(session_id);
  if (it == sessions_.end()) return NotFound("session '{}' does not exist", session_id);
  return it->second;
}

absl::StatusOr<std::vector<SessionInfo>> LocalMappingService::ListSessions() {
  std::vector<std::shared_ptr<Session>> sessions;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [id, session] : sessions_) sessions.push_back(session);
  }
  std::vector<SessionInfo> infos;
  for (const auto& session : sessions) infos.push_back(session->Info());
  std::sort(infos.begin(), infos.end(),
            [](const SessionInfo& a, const SessionInfo& b) { return a.created_unix_ns < b.created_unix_ns; });
  return infos;
}

absl::StatusOr<SessionInfo> LocalMappingService::GetSession(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  return session->Info();
}

absl::StatusOr<SessionInfo> LocalMappingService::FinishSession(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  session->Finish();
  return session->Info();
}

absl::Status LocalMappingService::DeleteSession(const std::string& session_id) {
  std::shared_ptr<Session> session;
  {
    std::lock_guard lock(mutex_);
    const auto it = sessions_.find(session_id);
    if (it == sessions_.end()) return NotFound("session '{}' does not exist", session_id);
    session = std::move(it->second);
    sessions_.erase(it);
  }
  session->Stop(NotFound("session '{}' was deleted", session_id));
  spdlog::info("session {}: deleted", session_id);
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<MapStream>> LocalMappingService::OpenMap(const std::string& session_id,
                                                                        const std::string& resume_token) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  ROMAP_RETURN_IF_ERROR(session->CheckOpen());
  StreamOpening opening;
  const std::shared_ptr<Outbox> outbox =
      session->map().Subscribe(Outbox::Acks::kAll, session->config().subscriber_queue, &opening.objects);
  auto holder = session->sender().Attach(resume_token, [session, outbox] {
    session->map().Unsubscribe(outbox);
    outbox->Close(absl::AbortedError("the client continues the session on another stream"));
  });
  if (!holder) {
    session->map().Unsubscribe(outbox);
    return FailedPrecondition("session '{}' already has a Map stream; close it first", session_id);
  }
  opening.resume_token = session->sender().token();
  opening.newest_frame_id = session->newest_frame_id();
  return std::make_unique<LocalEventStream>(session, outbox, std::move(opening), std::move(holder));
}

absl::StatusOr<std::unique_ptr<EventStream>> LocalMappingService::Watch(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  StreamOpening opening;
  auto outbox = session->map().Subscribe(Outbox::Acks::kNewest, /*max_acks=*/1, &opening.objects);
  opening.newest_frame_id = session->newest_frame_id();
  return std::make_unique<LocalEventStream>(session, std::move(outbox), std::move(opening), /*holder=*/nullptr);
}

absl::StatusOr<MapSnapshot> LocalMappingService::ExportMap(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto session, Find(session_id));
  return session->Export();
}

}  // namespace romap::session
