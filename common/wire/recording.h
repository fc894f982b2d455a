#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "common/client_input.h"
#include "common/mapping_service.h"

namespace romap::wire {

// What a session was fed, in a file, to be fed to another one later. Layout, numbers little-endian:
//
//   8 bytes "ROMAPREC", uint32 version = 2
//   records, each: uint32 length, then so many bytes of a message of romap.v1:
//     first CreateSessionRequest, then one MapRequest each (`frame` or `late_masks`), in order
//
// Version 1, which had no late masks, is read too: its records are Frames instead of MapRequests.
// Whatever stops the writer leaves whole records and at most one that is cut off at the end.
class RecordingWriter {
 public:
  // Makes the file, replacing one of that name. FAILED_PRECONDITION naming the path when that cannot be done.
  static absl::StatusOr<std::unique_ptr<RecordingWriter>> Create(const std::string& path,
                                                                 const SessionOptions& options);

  // Writes one record and hands it to the operating system: it survives the end of this process. RESOURCE_EXHAUSTED
  // naming the path when the disk refuses; the file is then of no further use to the writer.
  absl::Status Append(SessionInput input);

 private:
  explicit RecordingWriter(const std::string& path);
  absl::Status Write(const std::string& bytes);

  std::string path_;
  std::ofstream file_;
};

// Reads such a file. Only the places of the records are kept in memory. Several threads may Load() at a time.
class Recording {
 public:
  // Looks at every record once. NOT_FOUND: no such file. INVALID_ARGUMENT, naming the file and what was expected: not a
  // recording, another version, a first or other record that is no such message. A last record that is cut off is
  // left out and counted in lost_bytes().
  static absl::StatusOr<Recording> Open(const std::string& path);

  const std::string& path() const { return path_; }
  const SessionOptions& options() const { return options_; }
  size_t size() const { return places_.size(); }       // frames and late masks
  size_t frames() const { return frames_; }            // of them
  uint64_t lost_bytes() const { return lost_bytes_; }  // at the end of the file

  // What came as number `index` (< size()). INVALID_ARGUMENT naming file and record when it is nothing that may be
  // sent.
  absl::StatusOr<SessionInput> Load(size_t index) const;

 private:
  struct Place {
    uint64_t offset = 0;  // of the message, bytes
    uint32_t length = 0;  // bytes
  };

  absl::Status ReadHead(std::ifstream& file);
  absl::Status FindRecords(std::ifstream& file, uint64_t file_bytes);

  std::string path_;
  SessionOptions options_;
  uint32_t version_ = 0;
  std::vector<Place> places_;
  size_t frames_ = 0;
  uint64_t lost_bytes_ = 0;
};

}  // namespace romap::wire
