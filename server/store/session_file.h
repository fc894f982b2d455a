#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <string>

#include "server/store/stored_session.h"

namespace romap::store {

// A stored session as one file (*.romap), to archive it or to carry it to another server. Layout, numbers
// little-endian:
//
//   8 bytes "ROMAPSES", uint32 version = 1
//   records, each: uint8 kind, uint64 length, 16 bytes XXH3 of the content, content
//
// Kinds, in this order: 1 the session: a CreateSessionRequest; 2 its state: a SessionInfo; 3 an input: a MapRequest, as
// often as there are inputs; 4 an object: an ObjectUpdate, and 5 its mesh: a MeshUpdate; 6 the trajectory: a
// TrajectoryPiece; 7 the end: empty. The messages are those of romap.v1. A reader skips kinds that it does not know.
enum class FileRecord : uint8_t { kSession = 1, kState, kInput, kObject, kMesh, kTrajectory, kEnd };

std::string SessionFileHeader();
std::string SessionFileRecord(FileRecord kind, const std::string& content);

// Splits the bytes of a file into records while they arrive.
class SessionFileReader {
 public:
  using Sink = std::function<absl::Status(FileRecord kind, std::string content)>;

  explicit SessionFileReader(Sink sink) : sink_(std::move(sink)) {}

  // INVALID_ARGUMENT: not such a file, of a newer version, or damaged. Errors of the sink are returned.
  absl::Status Add(const std::string& bytes);
  // INVALID_ARGUMENT: the file is cut off.
  absl::Status End() const;

 private:
  absl::Status ReadRecords();

  const Sink sink_;
  std::string waiting_;  // bytes of an incomplete header or record
  bool has_header_ = false;
  bool has_end_ = false;
};

}  // namespace romap::store
