#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/client_input.h"
#include "common/mapping_service.h"

namespace romap::wire {

// A file with all inputs of a session, to be replayed to another session. Layout, numbers little-endian:
//
//   8 bytes "ROMAPREC", uint32 version = 2
//   records, each: uint32 length in bytes, then a message of romap.v1: first a CreateSessionRequest, then the
//     MapRequests (`frame` or `late_masks`) in order
//
// Version 1, without late masks, is also readable: its records are Frames instead of MapRequests.
// If the writer stops at any time, all records but the last are complete.
class RecordingWriter {
 public:
  // Creates the file; replaces an existing one. Errors as FileError() (common/file_status.h).
  static absl::StatusOr<std::unique_ptr<RecordingWriter>> Create(const std::string& path,
                                                                 const SessionOptions& options);

  // Writes one record and flushes it to the operating system, so that it survives a crash of this process. Errors as
  // FileError(); do not append after an error.
  absl::Status Append(SessionInput input);

 private:
  RecordingWriter(std::string path, std::ofstream file) : path_(std::move(path)), file_(std::move(file)) {}
  absl::Status Write(const std::string& bytes);

  std::string path_;
  std::ofstream file_;
};

// Reads a recording. Only the positions of the records are kept in memory. Load() is thread-safe.
class Recording {
 public:
  // Checks every record. Errors as FileError() if the file cannot be read. INVALID_ARGUMENT: not a recording, an
  // unknown version, or a damaged record. An incomplete last record is ignored and counted in lost_bytes().
  static absl::StatusOr<Recording> Open(const std::string& path);

  const std::string& path() const { return path_; }
  const SessionOptions& options() const { return options_; }
  size_t size() const { return positions_.size(); }    // frames and late masks
  size_t frames() const { return frames_; }            // without late masks
  uint64_t lost_bytes() const { return lost_bytes_; }  // at the end of the file

  // The input number `index`, < size(). INVALID_ARGUMENT: the record is damaged or not a valid input. Errors as
  // FileError() if the file can no longer be read.
  absl::StatusOr<SessionInput> Load(size_t index) const;

 private:
  struct Position {
    uint64_t offset = 0;  // of the message, bytes
    uint32_t length = 0;  // bytes
  };

  absl::Status ReadHeader(std::ifstream& file);
  absl::Status FindRecords(std::ifstream& file, uint64_t file_bytes);

  std::string path_;
  SessionOptions options_;
  uint32_t version_ = 0;
  std::vector<Position> positions_;
  size_t frames_ = 0;
  uint64_t lost_bytes_ = 0;
};

}  // namespace romap::wire
