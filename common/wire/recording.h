#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "common/mapping_service.h"
#include "common/messages.h"

namespace romap::wire {

// What a session was fed, in a file, to be fed to another one later. Layout, numbers little-endian:
//
//   8 bytes "ROMAPREC", uint32 version = 1
//   records, each: uint32 length, then so many bytes of a message of romap.v1:
//     first CreateSessionRequest, then one Frame each, in order
//
// Whatever stops the writer leaves whole records and at most one that is cut off at the end.
class RecordingWriter {
 public:
  // Makes the file, replacing one of that name. FAILED_PRECONDITION naming the path when that cannot be done.
  static absl::StatusOr<std::unique_ptr<RecordingWriter>> Create(const std::string& path,
                                                                 const SessionOptions& options);

  // Writes one frame and hands it to the operating system: it survives the end of this process. RESOURCE_EXHAUSTED
  // naming the path when the disk refuses; the file is then of no further use to the writer.
  absl::Status Append(FrameInput frame);

 private:
  explicit RecordingWriter(const std::string& path);
  absl::Status Write(const std::string& bytes);

  std::string path_;
  std::ofstream file_;
};

// Reads such a file. Only the places of the frames are kept in memory. Several threads may Load() at a time.
class Recording {
 public:
  // Looks at every record once. NOT_FOUND: no such file. INVALID_ARGUMENT, naming the file and what was expected: not a
  // recording, another version, a first record or a frame that is no such message. A last record that is cut off is
  // left out and counted in lost_bytes().
  static absl::StatusOr<Recording> Open(const std::string& path);

  const std::string& path() const { return path_; }
  const SessionOptions& options() const { return options_; }
  size_t size() const { return frames_.size(); }  // frames
  int64_t timestamp_ns(size_t index) const { return frames_[index].timestamp_ns; }
  bool has_mask(size_t index) const { return frames_[index].has_mask; }
  uint64_t lost_bytes() const { return lost_bytes_; }  // at the end of the file

  // Frame `index` (< size()). INVALID_ARGUMENT naming file and frame when it is not one that may be sent.
  absl::StatusOr<FrameInput> Load(size_t index) const;

 private:
  struct Place {
    uint64_t offset = 0;  // of the message, bytes
    uint32_t length = 0;  // bytes
    int64_t timestamp_ns = 0;
    bool has_mask = false;
  };

  absl::Status ReadHead(std::ifstream& file);
  absl::Status FindFrames(std::ifstream& file, uint64_t file_bytes);

  std::string path_;
  SessionOptions options_;
  std::vector<Place> frames_;
  uint64_t lost_bytes_ = 0;
};

}  // namespace romap::wire
