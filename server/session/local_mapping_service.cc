#include "server/session/local_mapping_service.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <thread>
#include <utility>

#include "common/random_id.h"
#include "common/status.h"
#include "common/unix_time.h"
#include "common/wire/recording.h"
#include "server/session/admission.h"
#include "server/session/local_streams.h"
#include "server/store/session_transfer.h"

namespace romap::session {
namespace {

constexpr size_t kMaxNameLength = 200;

int TrainingThreads(const ServerConfig& config) {
  if (config.session.single_thread) return 0;
  if (config.training_threads > 0) return config.training_threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

double Megapixels(const CameraModel& camera) { return 1e-6 * camera.width_px * camera.height_px; }

absl::Status CheckImageSize(const CameraModel& camera, double max_image_mpx) {
  const double mpx = Megapixels(camera);
  if (mpx <= max_image_mpx) return absl::OkStatus();
  return InvalidArgument(
      "camera: images must have at most {:.3g} megapixels (session.max_image_mpx), {}x{} px are {:.3g}; send smaller "
      "images, with intrinsics that fit them",
      max_image_mpx, camera.width_px, camera.height_px, mpx);
}

// Starts a session, new or restored. RESOURCE_EXHAUSTED: the server has no more threads or memory.
template <class... Arguments>
absl::StatusOr<std::shared_ptr<Session>> StartSession(const std::string& id, Arguments&&... arguments) {
  try {
    return std::make_shared<Session>(id, std::forward<Arguments>(arguments)...);
  } catch (const std::exception& e) {
    spdlog::error("session {}: cannot be started: {}", id, e.what());
    return absl::ResourceExhaustedError(fmt::format(
        "the server has too little memory or too few threads for one more session ({}); try again later", e.what()));
  }
}

}  // namespace

LocalMappingService::LocalMappingService(const ServerConfig& config, std::unique_ptr<store::Store> store)
    : config_(config),
      store_(std::move(store)),
      pool_(config.nerf, TrainingThreads(config)),
      mesher_(config.mesh, config.session.single_thread ? Mesher::Threading::kCaller : Mesher::Threading::kOwnThread) {
  if (store_) LoadShelf();
  keeper_thread_ = std::thread([this] { KeepSessions(); });
}

void LocalMappingService::LoadShelf() {
  auto stored = store_->Sessions();
  if (!stored.ok()) spdlog::error("store: {}", Message(stored.status()));
  shelf_ = std::make_unique<SessionShelf>(store_.get(),
                                          stored.ok() ? *std::move(stored) : std::vector<store::StoredSession>{});
  std::lock_guard lock(mutex_);
  for (const std::string& id : shelf_->Unfinished()) {
    if (const absl::Status status = RestoreLocked(id); !status.ok()) {
      spdlog::error("session {}: cannot be restored: {}", id, Message(status));
    }
  }
}

LocalMappingService::~LocalMappingService() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
    stopping_changed_.notify_all();
  }
  if (keeper_thread_.joinable()) keeper_thread_.join();
  // Sessions use the pool and the mesher, so they must end first.
  std::lock_guard lock(mutex_);
  for (const auto& [id, session] : sessions_) {
    session->StoreChanges(/*complete=*/true);
    session->Stop(absl::UnavailableError("the server is shutting down"));
  }
  sessions_.clear();
}

absl::StatusOr<SessionInfo> LocalMappingService::CreateSession(const SessionOptions& options) {
  ROMAP_RETURN_IF_ERROR(ValidateCameraModel(options.camera));
  ROMAP_RETURN_IF_ERROR(CheckImageSize(options.camera, config_.session.max_image_mpx));
  if (options.up_world && !(options.up_world->norm() >= 1e-9 && options.up_world->norm() <= 1e9)) {
    return InvalidArgument("up_world: must have a length in 1e-9..1e9, has {}", options.up_world->norm());
  }
  if (options.name.size() > kMaxNameLength) {
    return InvalidArgument("name: must have at most {} bytes, has {}", kMaxNameLength, options.name.size());
  }
  std::unique_lock lock(mutex_);
  if (sessions_.size() + sessions_in_creation_ >= static_cast<size_t>(config_.session.max_sessions)) {
    return absl::ResourceExhaustedError(
        fmt::format("the limit of {} sessions (session.max_sessions) is reached; delete a session first",
                    config_.session.max_sessions));
  }
  if (options.mode == FrameMode::kLive) ROMAP_RETURN_IF_ERROR(CheckLiveLoadLocked(options.camera));
  const std::string id = RandomId();
  std::unique_ptr<wire::RecordingWriter> recorder;
  if (!config_.session.record_dir.empty()) {
    const std::filesystem::path path = std::filesystem::path(config_.session.record_dir) / (id + ".romaprec");
    ROMAP_ASSIGN_OR_RETURN(recorder, wire::RecordingWriter::Create(path.string(), options));
  }
  const int64_t now_unix_ns = UnixNow_ns();
  if (store_) {
    ++sessions_in_creation_;
    lock.unlock();  // a slow disk must not delay other calls
    const absl::Status created =
        store_->Create({.id = id, .options = options, .created_unix_ns = now_unix_ns, .used_unix_ns = now_unix_ns});
    // While the disk fails, the session goes on in memory, and the store tries again.
    if (!created.ok()) spdlog::warn("session {}: is not stored yet: {}", id, Message(created));
    lock.lock();
    --sessions_in_creation_;
  }
  auto started = StartSession(id, options, now_unix_ns, config_, Services(), std::move(recorder));
  if (!started.ok()) {
    lock.unlock();
    if (store_) store_->Remove(id).IgnoreError();
    return started.status();
  }
  const std::shared_ptr<Session> session = *std::move(started);
  sessions_[id] = session;
  spdlog::info("session {}: created, {}x{} px", id, options.camera.width_px, options.camera.height_px);
  return session->Info();
}

absl::Status LocalMappingService::CheckLiveLoadLocked(const CameraModel& camera) const {
  if (config_.session.live_load <= 0) return absl::OkStatus();
  std::vector<LiveSession> live;
  for (const auto& [id, session] : sessions_) {
    const std::optional<double> cores = session->LiveCores();
    if (cores != 0.0) live.push_back({.image_mpx = Megapixels(session->camera()), .cores = cores});
  }
  return AdmitLiveSession(live, Megapixels(camera), config_.session.live_load * std::thread::hardware_concurrency());
}

std::map<std::string, std::shared_ptr<Session>> LocalMappingService::SessionsInMemory() {
  std::lock_guard lock(mutex_);
  return sessions_;
}

absl::StatusOr<std::shared_ptr<Session>> LocalMappingService::FindLocked(const std::string& session_id) {
  const auto it = sessions_.find(session_id);
  if (it != sessions_.end()) return it->second;
  if (shelf_ && shelf_->Contains(session_id)) return nullptr;
  return NotFound("session '{}' does not exist", session_id);
}

absl::Status LocalMappingService::RestoreLocked(const std::string& session_id) {
  ROMAP_RETURN_IF_ERROR(CheckImageSize(shelf_->Info(session_id).camera, config_.session.max_image_mpx));
  ROMAP_ASSIGN_OR_RETURN(auto taken, shelf_->Take(session_id));
  auto& [record, stored] = taken;
  auto started =
      StartSession(session_id, record.options, record.created_unix_ns, config_, Services(), std::move(stored));
  if (!started.ok()) {
    shelf_->Add(std::move(record));
    return started.status();
  }
  sessions_[session_id] = *std::move(started);
  return absl::OkStatus();
}

absl::StatusOr<std::vector<SessionInfo>> LocalMappingService::ListSessions() {
  std::vector<std::shared_ptr<Session>> sessions;
  std::vector<SessionInfo> infos;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [id, session] : sessions_) sessions.push_back(session);
    if (shelf_) infos = shelf_->Infos();
  }
  for (const auto& session : sessions) infos.push_back(session->Info());
  std::sort(infos.begin(), infos.end(),
            [](const SessionInfo& a, const SessionInfo& b) { return a.created_unix_ns < b.created_unix_ns; });
  return infos;
}

absl::StatusOr<SessionInfo> LocalMappingService::GetSession(const std::string& session_id) {
  std::unique_lock lock(mutex_);
  ROMAP_ASSIGN_OR_RETURN(const auto session, FindLocked(session_id));
  if (!session) return shelf_->Info(session_id);
  lock.unlock();
  return session->Info();
}

absl::StatusOr<SessionInfo> LocalMappingService::FinishSession(const std::string& session_id) {
  std::unique_lock lock(mutex_);
  ROMAP_ASSIGN_OR_RETURN(auto session, FindLocked(session_id));
  if (!session) {
    const SessionInfo info = shelf_->Info(session_id);
    if (info.state != SessionState::kOpen) return info;
    ROMAP_RETURN_IF_ERROR(RestoreLocked(session_id));
    session = sessions_.at(session_id);
  }
  lock.unlock();
  session->Finish();
  if (store_) {
    // The client may rely on it. While the disk fails, the session is finished in memory.
    session->StoreState();
    store_->Flush().IgnoreError();
  }
  return session->Info();
}

absl::Status LocalMappingService::DeleteSession(const std::string& session_id) {
  std::shared_ptr<Session> session;
  {
    std::lock_guard lock(mutex_);
    const auto it = sessions_.find(session_id);
    if (it != sessions_.end()) {
      session = std::move(it->second);
      sessions_.erase(it);
    } else if (shelf_ && shelf_->Contains(session_id)) {
      shelf_->Remove(session_id);
    } else {
      return NotFound("session '{}' does not exist", session_id);
    }
  }
  if (session && session->hangs()) {
    std::lock_guard lock(mutex_);
    hanging_.push_back(session);
  } else if (session) {
    session->Stop(NotFound("session '{}' was deleted", session_id));
  }
  if (store_) ROMAP_RETURN_IF_ERROR(store_->Remove(session_id));
  spdlog::info("session {}: deleted", session_id);
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<MapStream>> LocalMappingService::OpenMap(const std::string& session_id,
                                                                        const std::string& resume_token) {
  std::unique_lock lock(mutex_);
  ROMAP_ASSIGN_OR_RETURN(auto session, FindLocked(session_id));
  if (!session) {
    ROMAP_RETURN_IF_ERROR(RestoreLocked(session_id));
    session = sessions_.at(session_id);
  }
  lock.unlock();
  ROMAP_RETURN_IF_ERROR(session->CheckOpen());
  StreamOpening opening;
  const std::shared_ptr<Outbox> outbox =
      session->Subscribe(Outbox::Acks::kAll, session->config().subscriber_queue, &opening.objects);
  // The holder must not keep the session alive, because the session keeps the holder.
  auto holder = session->sender().Attach(resume_token, [weak = std::weak_ptr(session), outbox] {
    if (const auto replaced = weak.lock()) replaced->Unsubscribe(outbox);
    outbox->Close(absl::AbortedError("the client continues the session on another stream"));
  });
  if (!holder) {
    session->Unsubscribe(outbox);
    return FailedPrecondition("session '{}' already has a Map stream; close it first", session_id);
  }
  opening.resume_token = session->sender().token();
  opening.newest_frame_id = session->newest_frame_id();
  opening.durable = session->is_durable();
  return std::make_unique<LocalEventStream>(session, outbox, std::move(opening), std::move(holder));
}

absl::StatusOr<std::unique_ptr<EventStream>> LocalMappingService::Watch(const std::string& session_id) {
  std::unique_lock lock(mutex_);
  ROMAP_ASSIGN_OR_RETURN(const auto session, FindLocked(session_id));
  if (!session) {
    ROMAP_ASSIGN_OR_RETURN(auto map, shelf_->Map(session_id));
    return std::make_unique<ShelfStream>(std::move(map), store_->DurableInputs(session_id).frame_id);
  }
  lock.unlock();
  StreamOpening opening;
  auto outbox = session->Subscribe(Outbox::Acks::kNewest, /*max_acks=*/1, &opening.objects);
  opening.newest_frame_id = session->newest_frame_id();
  opening.durable = session->is_durable();
  return std::make_unique<LocalEventStream>(session, std::move(outbox), std::move(opening), /*holder=*/nullptr);
}

absl::StatusOr<MapSnapshot> LocalMappingService::ExportMap(const std::string& session_id) {
  std::unique_lock lock(mutex_);
  ROMAP_ASSIGN_OR_RETURN(const auto session, FindLocked(session_id));
  if (!session) return shelf_->Export(session_id);
  lock.unlock();
  return session->Export();
}

absl::StatusOr<SparsePoints> LocalMappingService::Points(const std::string& session_id) {
  std::unique_lock lock(mutex_);
  ROMAP_ASSIGN_OR_RETURN(const auto session, FindLocked(session_id));
  lock.unlock();
  return session ? session->live_view().Points() : SparsePoints{};
}

absl::StatusOr<CameraImage> LocalMappingService::NewestImage(const std::string& session_id, int max_side_px) {
  std::unique_lock lock(mutex_);
  ROMAP_ASSIGN_OR_RETURN(const auto session, FindLocked(session_id));
  lock.unlock();
  if (!session) return NotFound("session '{}' is not in memory, so it has no newest image", session_id);
  return session->live_view().Image(max_side_px);
}

bool LocalMappingService::HasHangingSession() {
  std::lock_guard lock(mutex_);
  return !hanging_.empty() || std::ranges::any_of(sessions_, [](const auto& entry) { return entry.second->hangs(); });
}

void LocalMappingService::StoreAll() {
  if (!store_) return;
  for (const auto& [id, session] : SessionsInMemory()) session->StoreChanges(/*complete=*/true);
  if (const absl::Status status = store_->Flush(); !status.ok()) spdlog::error("store: {}", Message(status));
}

ServiceMetrics LocalMappingService::Metrics() const {
  ServiceMetrics metrics = counters_.Read();
  if (!store_) return metrics;
  const store::Store::Backlog backlog = store_->GetBacklog();
  metrics.store_waiting_bytes = backlog.bytes;
  metrics.store_oldest_wait_s = backlog.oldest_wait_s;
  return metrics;
}

absl::Status LocalMappingService::CheckStore() const {
  if (store_) return absl::OkStatus();
  return FailedPrecondition("this service stores no sessions (romap-server --ephemeral, or romap --local)");
}

absl::Status LocalMappingService::SaveSession(const std::string& session_id, const PieceWriter& write) {
  std::unique_lock lock(mutex_);
  ROMAP_ASSIGN_OR_RETURN(const auto session, FindLocked(session_id));
  lock.unlock();
  ROMAP_RETURN_IF_ERROR(CheckStore());
  if (session) session->StoreChanges(/*complete=*/true);
  ROMAP_RETURN_IF_ERROR(store_->Flush());
  return store::SaveSession(*store_, session_id, write);
}

absl::StatusOr<SessionInfo> LocalMappingService::LoadSession(const PieceReader& read, const std::string& tenant) {
  ROMAP_RETURN_IF_ERROR(CheckStore());
  const std::string id = RandomId();
  ROMAP_ASSIGN_OR_RETURN(store::StoredSession stored, store::LoadSession(*store_, id, tenant, read));
  spdlog::info("session {}: loaded from a file, {} inputs", id, stored.inputs);
  std::lock_guard lock(mutex_);
  shelf_->Add(std::move(stored));
  return shelf_->Info(id);
}

absl::StatusOr<SessionInfo> LocalMappingService::PinSession(const std::string& session_id, bool pinned) {
  std::unique_lock lock(mutex_);
  ROMAP_ASSIGN_OR_RETURN(const auto session, FindLocked(session_id));
  ROMAP_RETURN_IF_ERROR(CheckStore());
  store_->SetPinned(session_id, pinned);
  if (!session) {
    shelf_->SetPinned(session_id, pinned);
    return shelf_->Info(session_id);
  }
  lock.unlock();
  session->SetPinned(pinned);
  return session->Info();
}

// -------------------------------------------------------------------------------------------------- the keeper thread

void LocalMappingService::KeepSessions() {
  constexpr std::chrono::milliseconds kPeriod{100};
  constexpr std::chrono::minutes kExpiryPeriod{10};
  auto next_expiry = std::chrono::steady_clock::now();
  std::unique_lock lock(mutex_);
  while (!stopping_changed_.wait_for(lock, kPeriod, [&] { return stopping_; })) {
    lock.unlock();
    try {
      CheckStages();
      DeleteAbandoned();
      if (store_) StoreChanges();
      const auto now = std::chrono::steady_clock::now();
      if (store_ && now >= next_expiry) {
        next_expiry = now + kExpiryPeriod;
        DeleteExpired();
      }
    } catch (const std::exception& e) {  // out of memory: the changes are stored in the next round
      spdlog::error("sessions: {}", e.what());
    }
    lock.lock();
  }
}

void LocalMappingService::CheckStages() {
  for (const auto& [id, session] : SessionsInMemory()) session->CheckStages();
}

void LocalMappingService::DeleteAbandoned() {
  if (config_.session.abandon_after_s == 0) return;
  const auto now = std::chrono::steady_clock::now();
  const std::chrono::duration<double> limit(config_.session.abandon_after_s);
  std::map<std::string, std::chrono::steady_clock::time_point> empty_since;
  std::vector<std::string> abandoned;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [id, session] : sessions_) {
      if (!session->IsEmpty()) continue;
      const auto known = empty_since_.find(id);
      const auto since = known == empty_since_.end() ? now : known->second;
      empty_since[id] = since;
      if (now - since > limit) abandoned.push_back(id);
    }
  }
  empty_since_ = std::move(empty_since);
  for (const std::string& id : abandoned) {
    spdlog::info("session {}: is deleted, because it got no input for {} s (session.abandon_after_s)", id,
                 config_.session.abandon_after_s);
    DeleteSession(id).IgnoreError();  // somebody else may have deleted it
  }
}

void LocalMappingService::StoreChanges() {
  if (!store_->AcceptsChanges()) return;  // they wait in the outboxes, where newer ones replace them
  const std::map<std::string, std::shared_ptr<Session>> sessions = SessionsInMemory();
  for (const auto& [id, session] : sessions) {
    const bool is_unused = store::HasEnded(session->state()) || IsUnused(id, *session);
    session->StoreChanges(/*complete=*/is_unused);
    // A session that could not be stored stays in memory.
    if (!is_unused || !store_->Flush().ok()) continue;
    if (const absl::Status compacted = store_->Compact(id); !compacted.ok()) {
      spdlog::warn("session {}: is not compacted: {}", id, Message(compacted));
    }
    Shelve(id, session);
  }
  std::erase_if(unused_since_, [&](const auto& entry) { return !sessions.contains(entry.first); });
}

bool LocalMappingService::IsUnused(const std::string& session_id, const Session& session) {
  const auto now = std::chrono::steady_clock::now();
  if (session.state() != SessionState::kOpen || !session.IsIdle()) {
    unused_since_.erase(session_id);
    return false;
  }
  const auto since = unused_since_.try_emplace(session_id, now).first->second;
  return now - since > std::chrono::duration<double>(config_.session.unload_after_s);
}

void LocalMappingService::Shelve(const std::string& session_id, std::shared_ptr<Session> session) {
  auto stored = store_->Sessions();
  if (!stored.ok()) return;
  const auto record = std::find_if(stored->begin(), stored->end(),
                                   [&](const store::StoredSession& candidate) { return candidate.id == session_id; });
  std::lock_guard lock(mutex_);
  const auto it = sessions_.find(session_id);
  if (it == sessions_.end() || record == stored->end()) return;  // deleted meanwhile
  const bool is_open = session->state() == SessionState::kOpen;
  if (is_open && !session->IsIdle()) return;  // somebody uses it again
  if (session->hangs()) hanging_.push_back(session);
  // Streams of an ended session keep it until they are closed.
  sessions_.erase(it);
  if (is_open) session->Stop(absl::UnavailableError("the session was unloaded; open the stream again"));
  shelf_->Add(std::move(*record));
}

void LocalMappingService::DeleteExpired() {
  std::vector<std::string> expired;
  {
    std::lock_guard lock(mutex_);
    const store::StoreConfig& limits = store_->config();
    expired = shelf_->Expired(limits.max_age_days, limits.max_gib * (1 << 30), UnixNow_ns());
  }
  for (const std::string& id : expired) {
    spdlog::info("session {}: expired", id);
    if (const absl::Status status = DeleteSession(id); !status.ok()) {
      spdlog::warn("session {}: cannot be deleted: {}", id, Message(status));
    }
  }
}

}  // namespace romap::session
