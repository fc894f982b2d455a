#pragma once

#include <SQLiteCpp/SQLiteCpp.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/map_events.h"
#include "server/store/blob_log.h"
#include "server/store/stored_session.h"

namespace romap::store {

// The index of a data folder: a SQLite database in WAL mode, which says what is stored and where its blobs are. All
// methods throw SQLite::Exception, except Open(). Not thread-safe; two catalogs may have the same file open.
class Catalog {
 public:
  enum class Mode { kReadWrite, kRead };

  // kReadWrite creates the database, or migrates it to the present schema. FAILED_PRECONDITION: a newer version of
  // romap wrote it. DATA_LOSS: it is damaged. Otherwise RESOURCE_EXHAUSTED.
  static absl::StatusOr<std::unique_ptr<Catalog>> Open(const std::string& path, Mode mode);

  // Changes between Begin() and Commit() become durable together, when Commit() returns.
  void Begin();
  void Commit();
  void Rollback();
  // Waits until the disk has what can be read, also commits of a process that was killed while it waited for the disk.
  void Synchronize();

  // ------------------------------------------------------------------------------------------------------- writing

  void PutSession(const StoredSession& session);
  void SetState(const std::string& session, SessionState state, const std::string& failure,
                const Statistics& statistics, int64_t now_unix_ns);
  void SetPinned(const std::string& session, bool pinned);
  void SetComplete(const std::string& session);
  // Sessions whose import was not completed.
  void RemoveIncomplete();
  void AddInput(const std::string& session, uint64_t number, bool is_masks, uint64_t frame_id, const BlobRef& blob);
  // Keeps its mesh.
  void PutObject(const std::string& session, const ObjectUpdate& object);
  void PutMesh(const std::string& session, ObjectId object, const BlobRef& blob);
  void RemoveObject(const std::string& session, ObjectId object);
  void PutTrajectory(const std::string& session, const BlobRef& blob);
  void RemoveSession(const std::string& session);

  // ------------------------------------------------------------------------------------------------------- reading

  std::vector<StoredSession> Sessions();
  bool HasSession(const std::string& session);
  uint64_t CountInputs(const std::string& session);
  struct LogEnd {
    uint32_t segment = 0;
    uint64_t offset = 0;
  };
  // All blobs of a session, each with the row that refers to it.
  struct StoredBlob {
    enum class Kind { kInput, kMesh, kTrajectory };
    Kind kind = Kind::kInput;
    uint64_t number = 0;  // of the input, or id of the object
    BlobRef blob;
  };
  std::vector<StoredBlob> Blobs(const std::string& session);
  void MoveBlob(const std::string& session, const StoredBlob& moved);
  // Those with blobs of a session.
  std::set<uint32_t> Segments(const std::string& session);
  // The end of the newest blob of a session.
  LogEnd EndOfBlobs(const std::string& session);
  std::optional<BlobRef> Input(const std::string& session, uint64_t number);
  Durable NewestInputs(const std::string& session);
  // Objects without their meshes, with the blobs of these. Objects whose record is damaged are added to `damage`.
  std::vector<std::pair<ObjectUpdate, std::optional<BlobRef>>> Objects(const std::string& session,
                                                                       std::vector<std::string>* damage);
  std::optional<BlobRef> TrajectoryBlob(const std::string& session);
  ObjectId LastObject(const std::string& session);

 private:
  Catalog(const std::string& path, Mode mode);
  void Migrate();
  SQLite::Statement& Prepared(const char* sql);

  SQLite::Database database_;
  std::vector<std::pair<const char*, std::unique_ptr<SQLite::Statement>>> prepared_;  // by the address of the text
};

}  // namespace romap::store
