#include "server/store/store.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include "common/status.h"
#include "common/unix_time.h"
#include "common/wire/events.h"
#include "server/store/blob_content.h"

namespace romap::store {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::seconds kRetryPeriod{1};

size_t SizeOf(const SessionInput& input) {
  const auto size_of_masks = [](const EncodedMasks& masks) {
    return masks.label_png.size() + 4 * masks.label_runs.size() + 64 * masks.instances.size();
  };
  if (const auto* frame = std::get_if<FrameInput>(&input)) {
    return frame->image.size() + frame->depth.size() + size_of_masks(*frame);
  }
  return size_of_masks(std::get<MasksInput>(input));
}

}  // namespace

// The changes of one batch, which count only if it is committed.
struct Store::Commitment {
  std::map<std::string, SessionLog*> logs;  // that the batch writes to
  std::map<std::string, uint64_t> inputs;   // number of inputs after the batch
  std::map<std::string, Durable> durable;   // of sessions with new inputs
  std::set<std::string> created, removed;
};

absl::StatusOr<std::unique_ptr<Store>> Store::Open(const StoreConfig& config) {
  const std::string path = config.data_dir.empty() ? DefaultDataDir() : config.data_dir;
  ROMAP_ASSIGN_OR_RETURN(DataFolder folder, DataFolder::Claim(path));
  const std::string catalog = fs::path(path) / "catalog.sqlite";
  ROMAP_ASSIGN_OR_RETURN(auto writer, Catalog::Open(catalog, Catalog::Mode::kReadWrite));
  ROMAP_ASSIGN_OR_RETURN(auto reader, Catalog::Open(catalog, Catalog::Mode::kRead));
  try {
    writer->RemoveIncomplete();
  } catch (const SQLite::Exception& e) {
    return absl::ResourceExhaustedError(fmt::format("{}: cannot write: {}", catalog, e.what()));
  }
  std::unique_ptr<Store> store(new Store(config, std::move(folder), std::move(writer), std::move(reader)));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<StoredSession> sessions, store->Sessions());
  store->SweepFolders(sessions);
  store->thread_ = std::thread([raw = store.get()] { raw->Run(); });
  return store;
}

Store::Store(StoreConfig config, DataFolder folder, std::unique_ptr<Catalog> writer, std::unique_ptr<Catalog> reader)
    : config_(std::move(config)), folder_(std::move(folder)), writer_(std::move(writer)), reader_(std::move(reader)) {}

Store::~Store() {
  {
    std::lock_guard lock(mutex_);
    closing_ = true;
    queued_.notify_all();
    written_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

std::string Store::FolderOf(const std::string& session) const { return fs::path(path()) / "sessions" / session; }

// A crash may leave the files of a session that was being created or removed, and old or new ones of a compaction.
void Store::SweepFolders(const std::vector<StoredSession>& sessions) const {
  std::set<std::string> known;
  for (const StoredSession& session : sessions) known.insert(session.id);
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(fs::path(path()) / "sessions", error)) {
    const std::string session = entry.path().filename();
    if (known.contains(session)) {
      SweepSegments(session);
    } else {
      fs::remove_all(entry.path(), error);
    }
  }
}

void Store::SweepSegments(const std::string& session) const {
  std::set<uint32_t> unused = BlobLog::Segments(FolderOf(session));
  if (unused.size() < 2) return;  // most sessions
  try {
    for (const uint32_t segment : writer_->Segments(session)) unused.erase(segment);
    if (unused.empty()) return;
    writer_->Synchronize();
    BlobLog::RemoveSegments(FolderOf(session), unused);
  } catch (const SQLite::Exception& e) {
    spdlog::warn("store: cannot remove old files of session {}: {}", session, e.what());
  }
}

// ------------------------------------------------------------------------------------------------------------ queue

void Store::Enqueue(Write write) {
  std::lock_guard lock(mutex_);
  if (!queue_since_) queue_since_ = Clock::now();
  queued_bytes_ += write.bytes;
  urgent_ = urgent_ || write.done != nullptr;
  queue_.push_back(std::move(write));
  queued_.notify_one();
}

absl::Status Store::EnqueueAndWait(Write write) {
  write.done = std::make_shared<std::promise<absl::Status>>();
  std::future<absl::Status> result = write.done->get_future();
  Enqueue(std::move(write));
  return result.get();
}

absl::Status Store::Create(const StoredSession& session) { return EnqueueAndWait({session.id, session}); }
absl::Status Store::Complete(const std::string& session) { return EnqueueAndWait({session, Completion{}}); }
absl::Status Store::Compact(const std::string& session) { return EnqueueAndWait({session, Compaction{}}); }
absl::Status Store::Remove(const std::string& session) { return EnqueueAndWait({session, Removal{}}); }
absl::Status Store::Flush() { return EnqueueAndWait({"", FlushMark{}}); }

void Store::AppendInput(const std::string& session, SessionInput input, bool may_wait) {
  Write write{session, InputWrite{std::move(input)}};
  write.bytes = SizeOf(std::get<InputWrite>(write.content).input);
  const size_t limit = static_cast<size_t>(config_.max_waiting_mib) << 20;
  {
    std::unique_lock lock(mutex_);
    const auto has_space = [&] { return queued_bytes_ + write.bytes <= limit || queue_.empty(); };
    if (may_wait) written_.wait(lock, [&] { return has_space() || failing_ || closing_; });
    if (!has_space()) {
      if (dropped_inputs_.emplace(session, false).second) queued_.notify_one();
      return;
    }
  }
  Enqueue(std::move(write));
}

bool Store::AcceptsChanges() const {
  std::lock_guard lock(mutex_);
  return !failing_ && queued_bytes_ <= static_cast<size_t>(config_.max_waiting_mib) << 20;
}

void Store::PutObject(const std::string& session, ObjectUpdate object) {
  Enqueue({session, std::move(object), sizeof(ObjectUpdate)});
}

void Store::PutMesh(const std::string& session, MeshUpdate mesh) {
  size_t bytes = mesh.draco.size() + mesh.texture.image.size();
  for (const MeshLevel& level : mesh.levels) bytes += level.draco.size();
  Enqueue({session, std::move(mesh), bytes});
}

void Store::RemoveObject(const std::string& session, ObjectId object) { Enqueue({session, object}); }

void Store::PutTrajectory(const std::string& session, std::vector<FrameAck> frames,
                          std::vector<int64_t> timestamps_ns) {
  const size_t bytes = frames.size() * sizeof(FrameAck);
  Enqueue({session, TrajectoryWrite{std::move(frames), std::move(timestamps_ns)}, bytes});
}

void Store::PutState(const std::string& session, SessionState state, std::string failure, Statistics statistics) {
  Enqueue({session, StateWrite{state, std::move(failure), std::move(statistics)}});
}

void Store::SetPinned(const std::string& session, bool pinned) { Enqueue({session, PinWrite{pinned}}); }

// ------------------------------------------------------------------------------------------------- the store's thread

void Store::Run() {
  while (true) {
    std::deque<Write> batch = TakeBatch();
    if (batch.empty()) return;  // closing
    while (true) {
      Commitment commitment;
      const absl::Status status = Commit(batch, &commitment);
      if (status.ok()) {
        Finish(batch, commitment);
        EndBatch();
        break;
      }
      Fail(batch, status);
      std::unique_lock lock(mutex_);
      if (queued_.wait_for(lock, kRetryPeriod, [&] { return closing_; })) return;
    }
  }
}

void Store::EndBatch() {
  std::lock_guard lock(mutex_);
  batch_bytes_ = 0;
  batch_since_.reset();
}

Store::Backlog Store::GetBacklog() const {
  std::lock_guard lock(mutex_);
  Backlog backlog{.bytes = queued_bytes_ + batch_bytes_};
  const auto since = batch_since_ ? batch_since_ : queue_since_;
  if (since) backlog.oldest_wait_s = std::chrono::duration<double>(Clock::now() - *since).count();
  return backlog;
}

std::deque<Store::Write> Store::TakeBatch() {
  std::unique_lock lock(mutex_);
  while (true) {
    queued_.wait(lock, [&] { return closing_ || !queue_.empty(); });
    if (!closing_ && !urgent_) {
      queued_.wait_for(lock, std::chrono::duration<double>(config_.commit_period_s),
                       [&] { return closing_ || urgent_; });
    }
    urgent_ = false;
    batch_bytes_ = std::exchange(queued_bytes_, 0);
    batch_since_ = std::exchange(queue_since_, std::nullopt);
    return std::exchange(queue_, {});
  }
}

absl::Status Store::Commit(const std::deque<Write>& batch, Commitment* commitment) {
  absl::Status status;
  try {
    writer_->Begin();
    for (const Write& write : batch) Apply(write, commitment);
    // The catalog must not refer to blobs that the disk does not have.
    for (const auto& [session, log] : commitment->logs) {
      status = log->blobs->Sync();
      if (!status.ok()) break;
    }
    if (status.ok()) writer_->Commit();
  } catch (const SQLite::Exception& e) {
    status = absl::ResourceExhaustedError(fmt::format("{}: cannot write: {}", path(), e.what()));
  } catch (const std::exception& e) {
    status = Internal("{}: cannot write: {}", path(), e.what());
  }
  if (status.ok()) return status;
  try {
    writer_->Rollback();
  } catch (const SQLite::Exception& e) {
    spdlog::warn("store: cannot roll back: {}", e.what());
  }
  for (const auto& [session, log] : commitment->logs) log->blobs->Discard();
  return status;
}

// Null: the session does not exist, because it was removed meanwhile.
Store::SessionLog* Store::LogOf(const std::string& session, Commitment* commitment) {
  if (commitment->removed.contains(session)) return nullptr;
  auto it = logs_.find(session);
  if (it == logs_.end()) {
    if (!commitment->created.contains(session) && !writer_->HasSession(session)) return nullptr;
    const Catalog::LogEnd end = writer_->EndOfBlobs(session);
    SessionLog log;
    log.blobs = std::make_unique<BlobLog>(FolderOf(session), end.segment, end.offset);
    log.inputs = writer_->CountInputs(session);
    log.newest = writer_->NewestInputs(session);
    it = logs_.emplace(session, std::move(log)).first;
  }
  commitment->logs[session] = &it->second;
  return &it->second;
}

void Store::Apply(const Write& write, Commitment* commitment) {
  const std::string& id = write.session;
  // A compaction follows the commit, see Finish().
  if (std::holds_alternative<FlushMark>(write.content) || std::holds_alternative<Compaction>(write.content)) return;
  if (const auto* session = std::get_if<StoredSession>(&write.content)) {
    writer_->PutSession(*session);
    commitment->created.insert(id);
    return;
  }
  SessionLog* const log = LogOf(id, commitment);
  if (log == nullptr) return;
  if (const auto* input = std::get_if<InputWrite>(&write.content)) {
    const auto* masks = std::get_if<MasksInput>(&input->input);
    const uint64_t frame_id = masks ? masks->frame_id : std::get<FrameInput>(input->input).frame_id;
    uint64_t& inputs = commitment->inputs.try_emplace(id, log->inputs).first->second;
    writer_->AddInput(id, ++inputs, masks != nullptr, frame_id, log->blobs->Append(InputContent(input->input)));
    Durable& durable = commitment->durable.try_emplace(id, log->newest).first->second;
    (masks ? durable.masks_frame_id : durable.frame_id) = frame_id;
  } else if (const auto* object = std::get_if<ObjectUpdate>(&write.content)) {
    writer_->PutObject(id, *object);
  } else if (const auto* mesh = std::get_if<MeshUpdate>(&write.content)) {
    writer_->PutMesh(id, mesh->id, log->blobs->Append(MeshContent(*mesh)));
  } else if (const auto* removed = std::get_if<ObjectId>(&write.content)) {
    writer_->RemoveObject(id, *removed);
  } else if (const auto* trajectory = std::get_if<TrajectoryWrite>(&write.content)) {
    writer_->PutTrajectory(id, log->blobs->Append(TrajectoryContent(trajectory->frames, trajectory->timestamps_ns)));
  } else if (const auto* state = std::get_if<StateWrite>(&write.content)) {
    writer_->SetState(id, state->state, state->failure, state->statistics, UnixNow_ns());
  } else if (const auto* pin = std::get_if<PinWrite>(&write.content)) {
    writer_->SetPinned(id, pin->pinned);
  } else if (std::holds_alternative<Completion>(write.content)) {
    writer_->SetComplete(id);
  } else if (std::holds_alternative<Removal>(write.content)) {
    writer_->RemoveSession(id);
    log->blobs->Discard();
    commitment->removed.insert(id);
  }
}

void Store::Finish(std::deque<Write>& batch, Commitment& commitment) {
  for (const std::string& session : commitment.removed) {
    logs_.erase(session);
    commitment.logs.erase(session);
    std::error_code error;
    fs::remove_all(FolderOf(session), error);
    if (error) spdlog::warn("store: cannot remove the files of session {}: {}", session, error.message());
  }
  bool was_failing = false;
  std::set<std::string> lacking, dropped;  // sessions that lack inputs, and those of them that do not know it yet
  {
    std::lock_guard lock(mutex_);
    was_failing = std::exchange(failing_, false);
    for (auto& [session, reported] : dropped_inputs_) {
      lacking.insert(session);
      if (!std::exchange(reported, true)) dropped.insert(session);
    }
    written_.notify_all();
  }
  for (auto& [session, log] : commitment.logs) {
    if (commitment.inputs.contains(session)) log->inputs = commitment.inputs[session];
    if (commitment.durable.contains(session)) log->newest = commitment.durable[session];
  }
  for (const std::string& session : dropped) {
    Notify(session, [](const Listener& listener) {
      listener.trouble(absl::DataLossError("the disk was too slow or failed for too long, so inputs were not stored"));
    });
  }
  if (was_failing) {
    spdlog::info("store: writes work again");
    std::lock_guard lock(listener_mutex_);
    for (const auto& [session, listener] : listeners_) listener.trouble(absl::OkStatus());
  }
  for (const auto& [session, durable] : commitment.durable) {
    if (commitment.removed.contains(session) || lacking.contains(session)) continue;
    Notify(session, [&durable = durable](const Listener& listener) { listener.durable(durable); });
  }
  for (Write& write : batch) {
    absl::Status status;
    if (std::holds_alternative<Compaction>(write.content)) status = CompactNow(write.session);
    if (write.done) write.done->set_value(status);
  }
}

absl::Status Store::CompactNow(const std::string& session) {
  constexpr double kMinDeadShare = 0.1;
  constexpr size_t kPieceBytes = 16 << 20;
  const std::string folder = FolderOf(session);
  absl::Status status;
  try {
    std::vector<Catalog::StoredBlob> blobs = writer_->Blobs(session);
    uint64_t live_bytes = 0;
    for (const auto& stored : blobs) live_bytes += stored.blob.EndOffset() - stored.blob.offset;
    if (static_cast<double>(live_bytes) > (1 - kMinDeadShare) * static_cast<double>(BytesOf(session))) return status;
    const uint32_t first = writer_->EndOfBlobs(session).segment + 1;
    auto copy = std::make_unique<BlobLog>(folder, first, 0);
    for (Catalog::StoredBlob& stored : blobs) {
      ROMAP_ASSIGN_OR_RETURN(const std::string content, BlobLog::Read(folder, stored.blob));
      stored.blob = copy->Append(content);
      if (copy->pending_bytes() > kPieceBytes) ROMAP_RETURN_IF_ERROR(copy->Sync());
    }
    ROMAP_RETURN_IF_ERROR(copy->Sync());
    writer_->Begin();
    for (const auto& stored : blobs) writer_->MoveBlob(session, stored);
    writer_->Commit();
    if (const auto log = logs_.find(session); log != logs_.end()) log->second.blobs = std::move(copy);
    std::set<uint32_t> old = BlobLog::Segments(folder);
    old.erase(old.lower_bound(first), old.end());
    BlobLog::RemoveSegments(folder, old);
  } catch (const SQLite::Exception& e) {
    status = absl::ResourceExhaustedError(fmt::format("{}: cannot compact: {}", path(), e.what()));
  }
  if (status.ok()) return status;
  try {
    writer_->Rollback();
  } catch (const SQLite::Exception& e) {
    spdlog::warn("store: cannot roll back: {}", e.what());
  }
  return status;
}

void Store::Fail(std::deque<Write>& batch, const absl::Status& status) {
  const auto answer = [&](Write& write) {
    if (write.done) write.done->set_value(status);
    write.done = nullptr;
  };
  bool is_new = false;
  {
    std::lock_guard lock(mutex_);
    is_new = !std::exchange(failing_, true);
    written_.notify_all();  // those that wait for space need not wait longer
    for (Write& write : queue_) answer(write);
  }
  if (is_new) {
    spdlog::error("store: {}; trying again every second", Message(status));
    std::lock_guard lock(listener_mutex_);
    for (const auto& [session, listener] : listeners_) listener.trouble(status);
  }
  for (Write& write : batch) answer(write);
}

void Store::Notify(const std::string& session, const std::function<void(const Listener&)>& call) {
  std::lock_guard lock(listener_mutex_);
  const auto it = listeners_.find(session);
  if (it != listeners_.end()) call(it->second);
}

void Store::SetListener(const std::string& session, Listener listener) {
  std::lock_guard lock(listener_mutex_);
  listeners_[session] = std::move(listener);
}

void Store::RemoveListener(const std::string& session) {
  std::lock_guard lock(listener_mutex_);
  listeners_.erase(session);
}

}  // namespace romap::store
