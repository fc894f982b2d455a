#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "common/client_input.h"
#include "common/map_events.h"
#include "server/store/blob_log.h"
#include "server/store/catalog.h"
#include "server/store/data_folder.h"
#include "server/store/store_config.h"
#include "server/store/stored_session.h"

namespace romap::store {

// What must survive a crash: the sessions with their accepted inputs and the map that clients saw. Writes are queued
// and return at once; the store's thread writes those of about 50 ms in one commit: the blobs first, then the catalog.
// While the disk fails, it tries again every second. Thread-safe.
class Store {
 public:
  // Of one session. Called on the store's thread; must not call the store.
  struct Listener {
    // Everything up to there is stored.
    std::function<void(const Durable&)> durable;
    // Not OK: writes fail, and why. OK: they work again. DATA_LOSS: inputs were not stored and never will be.
    std::function<void(const absl::Status&)> trouble;
  };

  // Opens or creates the data folder. FAILED_PRECONDITION: another process uses it, or a newer version wrote it.
  // DATA_LOSS: the catalog is damaged. Otherwise as FileError() (common/file_status.h).
  static absl::StatusOr<std::unique_ptr<Store>> Open(const StoreConfig& config);
  // Writes what is queued, unless the disk fails.
  ~Store();

  const std::string& path() const { return folder_.path(); }
  const StoreConfig& config() const { return config_; }
  // As they are in the catalog, oldest first. Without writes that are queued.
  absl::StatusOr<std::vector<StoredSession>> Sessions() const;
  // Of all files of the session.
  uint64_t BytesOf(const std::string& session) const;

  void SetListener(const std::string& session, Listener listener);
  // No calls of the listener follow.
  void RemoveListener(const std::string& session);

  // Waits until the session is durable. An error: the disk fails; the store still tries again.
  absl::Status Create(const StoredSession& session);
  // `may_wait`: blocks while too many writes wait for a slow disk. Otherwise the input is not stored then; nor is it if
  // the disk fails for so long. Then no later input of the session becomes durable.
  void AppendInput(const std::string& session, SessionInput input, bool may_wait);
  void PutObject(const std::string& session, ObjectUpdate object);
  // The object must have been put before.
  void PutMesh(const std::string& session, MeshUpdate mesh);
  void RemoveObject(const std::string& session, ObjectId object);
  void PutTrajectory(const std::string& session, std::vector<FrameAck> frames, std::vector<int64_t> timestamps_ns);
  void PutState(const std::string& session, SessionState state, std::string failure, Statistics statistics);
  void SetPinned(const std::string& session, bool pinned);
  // Waits until a session that was created incomplete is durable and listed.
  absl::Status Complete(const std::string& session);
  // Gives back the space of old versions of meshes and trajectories, if it is more than a tenth: copies the rest to new
  // segments. Other writes wait meanwhile. DATA_LOSS: a blob is damaged; then nothing changes.
  absl::Status Compact(const std::string& session);
  // Waits until the session and its files are removed.
  absl::Status Remove(const std::string& session);

  // False while the disk fails or is too slow: changes of maps should wait then, because they would fill the memory.
  bool AcceptsChanges() const;

  // The writes that are not durable yet.
  struct Backlog {
    size_t bytes = 0;
    double oldest_wait_s = 0;  // since the oldest of them was queued
  };
  Backlog GetBacklog() const;

  // Waits until all writes that were queued before are durable. An error: the disk fails.
  absl::Status Flush();

  Durable DurableInputs(const std::string& session) const;
  // Reads what is durable. DATA_LOSS: the input is damaged. NOT_FOUND: there is no input with this number (1, 2, ...).
  absl::StatusOr<SessionInput> LoadInput(const std::string& session, uint64_t number) const;
  // An error only if the catalog cannot be read.
  absl::StatusOr<StoredMap> LoadMap(const std::string& session) const;

 private:
  using Clock = std::chrono::steady_clock;
  struct InputWrite {
    SessionInput input;
  };
  struct TrajectoryWrite {
    std::vector<FrameAck> frames;
    std::vector<int64_t> timestamps_ns;
  };
  struct StateWrite {
    SessionState state = SessionState::kOpen;
    std::string failure;
    Statistics statistics;
  };
  struct PinWrite {
    bool pinned = false;
  };
  struct Completion {};
  struct Compaction {};
  struct Removal {};
  struct FlushMark {};
  struct Write {
    std::string session;
    std::variant<StoredSession, InputWrite, ObjectUpdate, MeshUpdate, ObjectId, TrajectoryWrite, StateWrite, PinWrite,
                 Completion, Compaction, Removal, FlushMark>
        content;
    size_t bytes = 0;
    std::shared_ptr<std::promise<absl::Status>> done = {};
  };
  // What the store's thread knows about a session that has writes.
  struct SessionLog {
    std::unique_ptr<BlobLog> blobs;
    uint64_t inputs = 0;
    Durable newest;  // of the committed writes
  };
  struct Commitment;
  // Where the parts of a map are that are not in the catalog.
  struct MapBlobs {
    std::vector<std::optional<BlobRef>> meshes;  // of all objects
    std::optional<BlobRef> trajectory;

    bool operator==(const MapBlobs&) const = default;
  };

  Store(StoreConfig config, DataFolder folder, std::unique_ptr<Catalog> writer, std::unique_ptr<Catalog> reader);

  void Enqueue(Write write);
  absl::Status EnqueueAndWait(Write write);
  void Run();
  std::deque<Write> TakeBatch();
  void EndBatch();
  absl::Status Commit(const std::deque<Write>& batch, Commitment* commitment);
  void Apply(const Write& write, Commitment* commitment);
  absl::Status CompactNow(const std::string& session);
  SessionLog* LogOf(const std::string& session, Commitment* commitment);
  void Finish(std::deque<Write>& batch, Commitment& commitment);
  void Fail(std::deque<Write>& batch, const absl::Status& status);
  void Notify(const std::string& session, const std::function<void(const Listener&)>& call);
  std::string FolderOf(const std::string& session) const;
  absl::StatusOr<MapBlobs> FindMap(const std::string& session, StoredMap* map) const;
  bool ReadMap(const std::string& session, const MapBlobs& blobs, StoredMap* map) const;
  void SweepFolders(const std::vector<StoredSession>& sessions) const;
  void SweepSegments(const std::string& session) const;

  const StoreConfig config_;
  const DataFolder folder_;
  const std::unique_ptr<Catalog> writer_;  // the store's thread
  mutable std::mutex read_mutex_;
  const std::unique_ptr<Catalog> reader_;   // guarded by read_mutex_
  std::map<std::string, SessionLog> logs_;  // the store's thread

  std::mutex listener_mutex_;  // held during the calls
  std::map<std::string, Listener> listeners_;

  mutable std::mutex mutex_;
  std::condition_variable queued_;   // writes were queued, or closing_ was set
  std::condition_variable written_;  // the queue became shorter
  std::deque<Write> queue_;
  size_t queued_bytes_ = 0;
  // When the oldest write was queued, of the queue and of the batch that is being committed; nullopt: there is none.
  std::optional<Clock::time_point> queue_since_, batch_since_;
  size_t batch_bytes_ = 0;
  bool failing_ = false;
  bool urgent_ = false;  // somebody waits for the next commit
  bool closing_ = false;
  std::map<std::string, bool> dropped_inputs_;  // sessions of which an input was not queued; true: reported
  std::thread thread_;
};

}  // namespace romap::store
