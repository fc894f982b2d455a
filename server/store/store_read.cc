#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "common/status.h"
#include "server/store/blob_content.h"
#include "server/store/store.h"

namespace romap::store {

absl::StatusOr<std::vector<StoredSession>> Store::Sessions() const {
  std::lock_guard lock(read_mutex_);
  try {
    return reader_->Sessions();
  } catch (const SQLite::Exception& e) {
    return absl::DataLossError(fmt::format("{}: the catalog cannot be read: {}", path(), e.what()));
  }
}

uint64_t Store::BytesOf(const std::string& session) const {
  uint64_t bytes = 0;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(FolderOf(session), error)) {
    const uint64_t size = entry.file_size(error);
    if (!error) bytes += size;
  }
  return bytes;
}

Durable Store::DurableInputs(const std::string& session) const {
  std::lock_guard lock(read_mutex_);
  try {
    return reader_->NewestInputs(session);
  } catch (const SQLite::Exception& e) {
    spdlog::error("store: {}: the catalog cannot be read: {}", path(), e.what());
    return {};
  }
}

absl::StatusOr<SessionInput> Store::LoadInput(const std::string& session, uint64_t number) const {
  absl::StatusOr<std::string> content;
  // A compaction may move the blob between the two steps.
  for (int attempt = 0; attempt < 2; ++attempt) {
    std::optional<BlobRef> blob;
    {
      std::lock_guard lock(read_mutex_);
      try {
        blob = reader_->Input(session, number);
      } catch (const SQLite::Exception& e) {
        return absl::DataLossError(fmt::format("{}: the catalog cannot be read: {}", path(), e.what()));
      }
    }
    if (!blob) return NotFound("session '{}' has no stored input {}", session, number);
    content = BlobLog::Read(FolderOf(session), *blob);
    if (content.ok() || !absl::IsNotFound(content.status())) break;
  }
  if (absl::IsNotFound(content.status())) return absl::DataLossError(Message(content.status()));
  ROMAP_RETURN_IF_ERROR(content.status());
  return ParseInput(*content);
}

absl::StatusOr<StoredMap> Store::LoadMap(const std::string& session) const {
  std::optional<MapBlobs> before;
  while (true) {
    StoredMap map;
    ROMAP_ASSIGN_OR_RETURN(const MapBlobs blobs, FindMap(session, &map));
    // A compaction may move blobs between the two steps.
    if (ReadMap(session, blobs, &map) || blobs == before) return map;
    before = blobs;
  }
}

// Reads the part of the map that is in the catalog.
absl::StatusOr<Store::MapBlobs> Store::FindMap(const std::string& session, StoredMap* map) const {
  MapBlobs blobs;
  std::lock_guard lock(read_mutex_);
  try {
    for (auto& [object, mesh] : reader_->Objects(session, &map->damage)) {
      map->objects.push_back({.object = std::move(object), .mesh = std::nullopt});
      blobs.meshes.push_back(std::move(mesh));
    }
    blobs.trajectory = reader_->TrajectoryBlob(session);
    map->last_object = reader_->LastObject(session);
  } catch (const SQLite::Exception& e) {
    return absl::DataLossError(fmt::format("{}: the catalog cannot be read: {}", path(), e.what()));
  }
  return blobs;
}

// Reads the blobs. False if the file of one does not exist.
bool Store::ReadMap(const std::string& session, const MapBlobs& blobs, StoredMap* map) const {
  bool exist = true;
  const auto read = [&](const BlobRef& blob) {
    auto content = BlobLog::Read(FolderOf(session), blob);
    if (absl::IsNotFound(content.status())) exist = false;
    return content;
  };
  for (size_t i = 0; i < map->objects.size(); ++i) {
    if (!blobs.meshes[i]) continue;
    const auto content = read(*blobs.meshes[i]);
    auto mesh = content.ok() ? ParseMesh(*content) : content.status();
    if (mesh.ok()) {
      map->objects[i].mesh = *std::move(mesh);
    } else {
      map->damage.push_back(
          fmt::format("mesh of {}: {}", map->objects[i].object.id.ToString(), Message(mesh.status())));
    }
  }
  if (blobs.trajectory) {
    const auto content = read(*blobs.trajectory);
    const absl::Status parsed =
        content.ok() ? ParseTrajectory(*content, &map->trajectory, &map->timestamps_ns) : content.status();
    if (!parsed.ok()) map->damage.push_back("trajectory: " + Message(parsed));
  }
  return exist;
}

}  // namespace romap::store
