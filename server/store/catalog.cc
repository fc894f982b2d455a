#include "server/store/catalog.h"

#include <sqlite3.h>

#include <algorithm>
#include <tuple>

#include "common/status.h"
#include "common/wire/events.h"
#include "common/wire/sessions.h"
#include "romap/v1/mapping.pb.h"
#include "server/store/blob_content.h"

namespace romap::store {
namespace {

constexpr int kSchemaVersion = 2;

// Migration number i leads from schema i to schema i + 1.
constexpr const char* kMigrations[] = {
    R"(
CREATE TABLE sessions(
  id TEXT PRIMARY KEY,
  options BLOB NOT NULL,            -- romap.v1.CreateSessionRequest
  created_unix_ns INTEGER NOT NULL,
  used_unix_ns INTEGER NOT NULL,
  state INTEGER NOT NULL,           -- romap.v1.SessionState
  failure TEXT NOT NULL,
  statistics BLOB NOT NULL,         -- romap.v1.Statistics
  pinned INTEGER NOT NULL,
  complete INTEGER NOT NULL,        -- 0: it is being imported
  last_object INTEGER NOT NULL DEFAULT 0,  -- the largest id that was ever used
  trajectory_segment INTEGER, trajectory_offset INTEGER, trajectory_length INTEGER, trajectory_hash BLOB
) WITHOUT ROWID;
CREATE TABLE inputs(
  session TEXT NOT NULL REFERENCES sessions(id) ON DELETE CASCADE,
  number INTEGER NOT NULL,          -- 1, 2, ... in the order in which they were accepted
  is_masks INTEGER NOT NULL,        -- 0: a frame, 1: late masks
  frame_id INTEGER NOT NULL,        -- the bits of the unsigned id
  segment INTEGER NOT NULL, offset INTEGER NOT NULL, length INTEGER NOT NULL, hash BLOB NOT NULL,
  PRIMARY KEY(session, number)
) WITHOUT ROWID;
CREATE TABLE objects(
  session TEXT NOT NULL REFERENCES sessions(id) ON DELETE CASCADE,
  object INTEGER NOT NULL,
  content BLOB NOT NULL,            -- romap.v1.ObjectUpdate
  mesh_segment INTEGER, mesh_offset INTEGER, mesh_length INTEGER, mesh_hash BLOB,
  PRIMARY KEY(session, object)
) WITHOUT ROWID;
)",
    "ALTER TABLE sessions ADD COLUMN tenant TEXT NOT NULL DEFAULT ''"};
static_assert(std::size(kMigrations) == kSchemaVersion);

std::string Text(const SQLite::Column& column) {
  return {static_cast<const char*>(column.getBlob()), static_cast<size_t>(column.getBytes())};
}

int64_t Bits(uint64_t value) { return static_cast<int64_t>(value); }

void BindBlob(SQLite::Statement& statement, int first, const BlobRef& blob) {
  statement.bind(first, static_cast<int64_t>(blob.segment));
  statement.bind(first + 1, Bits(blob.offset));
  statement.bind(first + 2, Bits(blob.length));
  statement.bind(first + 3, blob.hash.data(), static_cast<int>(blob.hash.size()));
}

std::optional<BlobRef> ReadBlobRef(SQLite::Statement& statement, int first) {
  if (statement.getColumn(first).isNull()) return std::nullopt;
  return BlobRef{.segment = static_cast<uint32_t>(statement.getColumn(first).getInt64()),
                 .offset = static_cast<uint64_t>(statement.getColumn(first + 1).getInt64()),
                 .length = static_cast<uint64_t>(statement.getColumn(first + 2).getInt64()),
                 .hash = Text(statement.getColumn(first + 3))};
}

void BindBytes(SQLite::Statement& statement, int index, const google::protobuf::MessageLite& message) {
  const std::string bytes = message.SerializeAsString();
  statement.bind(index, bytes.data(), static_cast<int>(bytes.size()));
}

void Run(SQLite::Statement& statement) {
  statement.exec();
  statement.reset();
}

v1::SessionState ToStored(SessionState state) {
  switch (state) {
    case SessionState::kFinishing:
      return v1::SESSION_STATE_FINISHING;
    case SessionState::kFinished:
      return v1::SESSION_STATE_FINISHED;
    case SessionState::kFailed:
      return v1::SESSION_STATE_FAILED;
    default:
      return v1::SESSION_STATE_OPEN;
  }
}

SessionState FromStored(int state) {
  switch (state) {
    case v1::SESSION_STATE_FINISHING:
      return SessionState::kFinishing;
    case v1::SESSION_STATE_FINISHED:
      return SessionState::kFinished;
    case v1::SESSION_STATE_FAILED:
      return SessionState::kFailed;
    default:
      return SessionState::kOpen;
  }
}

}  // namespace

Catalog::Catalog(const std::string& path, Mode mode)
    : database_(path, mode == Mode::kRead ? SQLite::OPEN_READONLY : SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE,
                /*busyTimeout_ms=*/5000) {}

absl::StatusOr<std::unique_ptr<Catalog>> Catalog::Open(const std::string& path, Mode mode) {
  try {
    std::unique_ptr<Catalog> catalog(new Catalog(path, mode));
    const int version = catalog->database_.execAndGet("PRAGMA user_version").getInt();
    if (version > kSchemaVersion) {
      return FailedPrecondition(
          "{}: has schema {}, but this version of romap knows only schemas up to {}; use a newer version", path,
          version, kSchemaVersion);
    }
    catalog->database_.exec("PRAGMA foreign_keys = ON");
    if (mode == Mode::kReadWrite) catalog->Migrate();
    return catalog;
  } catch (const SQLite::Exception& e) {
    const int code = e.getErrorCode();
    if (code == SQLITE_CORRUPT || code == SQLITE_NOTADB) {
      return absl::DataLossError(fmt::format("{}: the catalog is damaged: {}", path, e.what()));
    }
    return absl::ResourceExhaustedError(fmt::format("{}: cannot open the catalog: {}", path, e.what()));
  }
}

void Catalog::Migrate() {
  database_.exec("PRAGMA journal_mode = WAL");
  database_.exec("PRAGMA synchronous = FULL");  // a commit is durable when it returns
  const int version = database_.execAndGet("PRAGMA user_version").getInt();
  if (version == kSchemaVersion) return;
  SQLite::Transaction transaction(database_);
  for (int i = version; i < kSchemaVersion; ++i) database_.exec(kMigrations[i]);
  database_.exec(fmt::format("PRAGMA user_version = {}", kSchemaVersion));
  transaction.commit();
}

SQLite::Statement& Catalog::Prepared(const char* sql) {
  for (auto& [text, statement] : prepared_) {
    if (text != sql) continue;
    statement->reset();
    statement->clearBindings();
    return *statement;
  }
  return *prepared_.emplace_back(sql, std::make_unique<SQLite::Statement>(database_, sql)).second;
}

void Catalog::Begin() { database_.exec("BEGIN IMMEDIATE"); }
void Catalog::Commit() { database_.exec("COMMIT"); }
void Catalog::Rollback() {
  // Some errors end the transaction.
  if (sqlite3_get_autocommit(database_.getHandle()) == 0) database_.exec("ROLLBACK");
}

void Catalog::Synchronize() { database_.execAndGet("PRAGMA wal_checkpoint(FULL)"); }

void Catalog::PutSession(const StoredSession& session) {
  static constexpr char kSql[] =
      "INSERT INTO sessions(id, options, created_unix_ns, used_unix_ns, state, failure, statistics, pinned, complete, "
      "tenant) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?)";
  SQLite::Statement& statement = Prepared(kSql);
  statement.bind(1, session.id);
  BindBytes(statement, 2, wire::ToProto(session.options));
  statement.bind(3, session.created_unix_ns);
  statement.bind(4, session.used_unix_ns);
  statement.bind(5, static_cast<int>(ToStored(session.state)));
  statement.bind(6, session.failure);
  BindBytes(statement, 7, wire::ToProto(session.statistics));
  statement.bind(8, session.pinned ? 1 : 0);
  statement.bind(9, session.complete ? 1 : 0);
  statement.bind(10, session.options.tenant);
  Run(statement);
}

void Catalog::SetState(const std::string& session, SessionState state, const std::string& failure,
                       const Statistics& statistics, int64_t now_unix_ns) {
  static constexpr char kSql[] =
      "UPDATE sessions SET state = ?, failure = ?, statistics = ?, used_unix_ns = max(used_unix_ns, ?) WHERE id = ?";
  SQLite::Statement& statement = Prepared(kSql);
  statement.bind(1, static_cast<int>(ToStored(state)));
  statement.bind(2, failure);
  BindBytes(statement, 3, wire::ToProto(statistics));
  statement.bind(4, now_unix_ns);
  statement.bind(5, session);
  Run(statement);
}

void Catalog::SetPinned(const std::string& session, bool pinned) {
  static constexpr char kSql[] = "UPDATE sessions SET pinned = ? WHERE id = ?";
  SQLite::Statement& statement = Prepared(kSql);
  statement.bind(1, pinned ? 1 : 0);
  statement.bind(2, session);
  Run(statement);
}

void Catalog::SetComplete(const std::string& session) {
  static constexpr char kSql[] = "UPDATE sessions SET complete = 1 WHERE id = ?";
  SQLite::Statement& statement = Prepared(kSql);
  statement.bind(1, session);
  Run(statement);
}

void Catalog::RemoveIncomplete() { database_.exec("DELETE FROM sessions WHERE NOT complete"); }

void Catalog::AddInput(const std::string& session, uint64_t number, bool is_masks, uint64_t frame_id,
                       const BlobRef& blob) {
  static constexpr char kSql[] =
      "INSERT INTO inputs(session, number, is_masks, frame_id, segment, offset, length, hash) "
      "VALUES(?, ?, ?, ?, ?, ?, ?, ?)";
  SQLite::Statement& statement = Prepared(kSql);
  statement.bind(1, session);
  statement.bind(2, Bits(number));
  statement.bind(3, is_masks ? 1 : 0);
  statement.bind(4, Bits(frame_id));
  BindBlob(statement, 5, blob);
  Run(statement);
}

void Catalog::PutObject(const std::string& session, const ObjectUpdate& object) {
  static constexpr char kSql[] =
      "INSERT INTO objects(session, object, content) VALUES(?, ?, ?) "
      "ON CONFLICT(session, object) DO UPDATE SET content = excluded.content";
  SQLite::Statement& statement = Prepared(kSql);
  statement.bind(1, session);
  statement.bind(2, Bits(object.id.value));
  const std::string content = ObjectContent(object);
  statement.bind(3, content.data(), static_cast<int>(content.size()));
  Run(statement);
  static constexpr char kLast[] = "UPDATE sessions SET last_object = max(last_object, ?) WHERE id = ?";
  SQLite::Statement& last = Prepared(kLast);
  last.bind(1, Bits(object.id.value));
  last.bind(2, session);
  Run(last);
}

void Catalog::PutMesh(const std::string& session, ObjectId object, const BlobRef& blob) {
  static constexpr char kSql[] =
      "UPDATE objects SET mesh_segment = ?, mesh_offset = ?, mesh_length = ?, mesh_hash = ? "
      "WHERE session = ? AND object = ?";
  SQLite::Statement& statement = Prepared(kSql);
  BindBlob(statement, 1, blob);
  statement.bind(5, session);
  statement.bind(6, Bits(object.value));
  Run(statement);
}

void Catalog::RemoveObject(const std::string& session, ObjectId object) {
  static constexpr char kSql[] = "DELETE FROM objects WHERE session = ? AND object = ?";
  SQLite::Statement& statement = Prepared(kSql);
  statement.bind(1, session);
  statement.bind(2, Bits(object.value));
  Run(statement);
}

void Catalog::PutTrajectory(const std::string& session, const BlobRef& blob) {
  static constexpr char kSql[] =
      "UPDATE sessions SET trajectory_segment = ?, trajectory_offset = ?, trajectory_length = ?, trajectory_hash = ? "
      "WHERE id = ?";
  SQLite::Statement& statement = Prepared(kSql);
  BindBlob(statement, 1, blob);
  statement.bind(5, session);
  Run(statement);
}

void Catalog::RemoveSession(const std::string& session) {
  static constexpr char kSql[] = "DELETE FROM sessions WHERE id = ?";
  SQLite::Statement& statement = Prepared(kSql);
  statement.bind(1, session);
  Run(statement);
}

std::vector<StoredSession> Catalog::Sessions() {
  SQLite::Statement statement(
      database_,
      "SELECT id, options, created_unix_ns, used_unix_ns, state, failure, statistics, pinned, "
      "(SELECT count(*) FROM inputs WHERE session = id), tenant FROM sessions WHERE complete ORDER BY created_unix_ns");
  std::vector<StoredSession> sessions;
  while (statement.executeStep()) {
    StoredSession session;
    session.id = statement.getColumn(0).getString();
    session.created_unix_ns = statement.getColumn(2).getInt64();
    session.used_unix_ns = statement.getColumn(3).getInt64();
    session.state = FromStored(statement.getColumn(4).getInt());
    session.failure = statement.getColumn(5).getString();
    session.pinned = statement.getColumn(7).getInt() != 0;
    session.inputs = static_cast<uint64_t>(statement.getColumn(8).getInt64());
    v1::CreateSessionRequest request;
    request.ParseFromString(Text(statement.getColumn(1)));
    auto options = wire::FromProto(request);
    v1::Statistics statistics;
    statistics.ParseFromString(Text(statement.getColumn(6)));
    auto counts = wire::FromProto(statistics, "statistics");
    if (options.ok()) {
      session.options = *std::move(options);
    } else {
      session.state = SessionState::kFailed;
      session.failure = "its stored options are damaged: " + Message(options.status());
    }
    session.options.tenant = statement.getColumn(9).getString();
    if (counts.ok()) session.statistics = *std::move(counts);
    sessions.push_back(std::move(session));
  }
  return sessions;
}

bool Catalog::HasSession(const std::string& session) {
  SQLite::Statement statement(database_, "SELECT 1 FROM sessions WHERE id = ?");
  statement.bind(1, session);
  return statement.executeStep();
}

uint64_t Catalog::CountInputs(const std::string& session) {
  SQLite::Statement statement(database_, "SELECT coalesce(max(number), 0) FROM inputs WHERE session = ?");
  statement.bind(1, session);
  statement.executeStep();
  return static_cast<uint64_t>(statement.getColumn(0).getInt64());
}

std::vector<Catalog::StoredBlob> Catalog::Blobs(const std::string& session) {
  std::vector<StoredBlob> blobs;
  const auto add = [&](StoredBlob::Kind kind, const char* sql) {
    SQLite::Statement statement(database_, sql);
    statement.bind(1, session);
    while (statement.executeStep()) {
      const auto blob = ReadBlobRef(statement, 1);
      if (blob) blobs.push_back({kind, static_cast<uint64_t>(statement.getColumn(0).getInt64()), *blob});
    }
  };
  add(StoredBlob::Kind::kInput,
      "SELECT number, segment, offset, length, hash FROM inputs WHERE session = ? ORDER BY number");
  add(StoredBlob::Kind::kMesh,
      "SELECT object, mesh_segment, mesh_offset, mesh_length, mesh_hash FROM objects WHERE session = ?");
  add(StoredBlob::Kind::kTrajectory,
      "SELECT 0, trajectory_segment, trajectory_offset, trajectory_length, trajectory_hash FROM sessions WHERE id = ?");
  return blobs;
}

std::set<uint32_t> Catalog::Segments(const std::string& session) {
  SQLite::Statement statement(
      database_,
      "SELECT DISTINCT segment FROM inputs WHERE session = ?1 "
      "UNION SELECT mesh_segment FROM objects WHERE session = ?1 AND mesh_segment NOT NULL "
      "UNION SELECT trajectory_segment FROM sessions WHERE id = ?1 AND trajectory_segment NOT NULL");
  statement.bind(1, session);
  std::set<uint32_t> segments;
  while (statement.executeStep()) segments.insert(static_cast<uint32_t>(statement.getColumn(0).getInt64()));
  return segments;
}

void Catalog::MoveBlob(const std::string& session, const StoredBlob& moved) {
  if (moved.kind == StoredBlob::Kind::kMesh) return PutMesh(session, ObjectId{moved.number}, moved.blob);
  if (moved.kind == StoredBlob::Kind::kTrajectory) return PutTrajectory(session, moved.blob);
  static constexpr char kSql[] =
      "UPDATE inputs SET segment = ?, offset = ?, length = ?, hash = ? WHERE session = ? AND number = ?";
  SQLite::Statement& statement = Prepared(kSql);
  BindBlob(statement, 1, moved.blob);
  statement.bind(5, session);
  statement.bind(6, Bits(moved.number));
  Run(statement);
}

Catalog::LogEnd Catalog::EndOfBlobs(const std::string& session) {
  LogEnd end;
  // An empty log ends at 0, 0.
  const auto extend = [&](const std::optional<BlobRef>& blob) {
    if (!blob || std::tie(blob->segment, blob->offset) < std::make_tuple(end.segment, end.offset)) return;
    end = {blob->segment, blob->EndOffset()};
  };
  SQLite::Statement inputs(database_,
                           "SELECT segment, offset, length, hash FROM inputs WHERE session = ? "
                           "ORDER BY number DESC LIMIT 1");
  inputs.bind(1, session);
  while (inputs.executeStep()) extend(ReadBlobRef(inputs, 0));
  SQLite::Statement meshes(database_,
                           "SELECT mesh_segment, mesh_offset, mesh_length, mesh_hash FROM objects WHERE session = ?");
  meshes.bind(1, session);
  while (meshes.executeStep()) extend(ReadBlobRef(meshes, 0));
  extend(TrajectoryBlob(session));
  return end;
}

std::optional<BlobRef> Catalog::Input(const std::string& session, uint64_t number) {
  static constexpr char kSql[] = "SELECT segment, offset, length, hash FROM inputs WHERE session = ? AND number = ?";
  SQLite::Statement& statement = Prepared(kSql);
  statement.bind(1, session);
  statement.bind(2, Bits(number));
  std::optional<BlobRef> blob;
  if (statement.executeStep()) blob = ReadBlobRef(statement, 0);
  statement.reset();  // otherwise it would keep the database from truncating its log
  return blob;
}

Durable Catalog::NewestInputs(const std::string& session) {
  Durable newest;
  for (const bool is_masks : {false, true}) {
    SQLite::Statement statement(database_,
                                "SELECT frame_id FROM inputs WHERE session = ? AND is_masks = ? "
                                "ORDER BY number DESC LIMIT 1");
    statement.bind(1, session);
    statement.bind(2, is_masks ? 1 : 0);
    if (!statement.executeStep()) continue;
    (is_masks ? newest.masks_frame_id : newest.frame_id) = static_cast<uint64_t>(statement.getColumn(0).getInt64());
  }
  return newest;
}

std::vector<std::pair<ObjectUpdate, std::optional<BlobRef>>> Catalog::Objects(const std::string& session,
                                                                              std::vector<std::string>* damage) {
  SQLite::Statement statement(database_,
                              "SELECT mesh_segment, mesh_offset, mesh_length, mesh_hash, content, object FROM objects "
                              "WHERE session = ? ORDER BY object");
  statement.bind(1, session);
  std::vector<std::pair<ObjectUpdate, std::optional<BlobRef>>> objects;
  while (statement.executeStep()) {
    auto object = ParseObject(Text(statement.getColumn(4)));
    if (object.ok()) {
      objects.emplace_back(*std::move(object), ReadBlobRef(statement, 0));
    } else {
      damage->push_back(fmt::format("object {}: {}", statement.getColumn(5).getInt64(), Message(object.status())));
    }
  }
  return objects;
}

ObjectId Catalog::LastObject(const std::string& session) {
  SQLite::Statement statement(database_, "SELECT last_object FROM sessions WHERE id = ?");
  statement.bind(1, session);
  return statement.executeStep() ? ObjectId{static_cast<uint64_t>(statement.getColumn(0).getInt64())} : ObjectId{};
}

std::optional<BlobRef> Catalog::TrajectoryBlob(const std::string& session) {
  SQLite::Statement statement(database_,
                              "SELECT trajectory_segment, trajectory_offset, trajectory_length, trajectory_hash "
                              "FROM sessions WHERE id = ?");
  statement.bind(1, session);
  return statement.executeStep() ? ReadBlobRef(statement, 0) : std::nullopt;
}

}  // namespace romap::store
