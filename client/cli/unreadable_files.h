#pragma once

#include <absl/status/status.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/files/sequence.h"
#include "common/diagnostic.h"

namespace romap::cli {

// The files of a run that could not be read. The run goes on without them, unless they are too many. Not thread-safe.
class UnreadableFiles {
 public:
  // Frames `first` to `end` - 1 of the sequence are sent.
  UnreadableFiles(const files::Sequence& sequence, size_t first, size_t end);

  // Counts an unreadable file of a frame. The code of its status, if more than files::kMaxUnreadableShare of the files
  // of this kind are unreadable; the message states the count and the first file.
  absl::Status Note(uint64_t frame_id, const files::UnreadableFile& file);

  // The diagnostic about a file of this kind in this frame, if it is the first one of its kind.
  std::optional<Diagnostic> FirstOf(files::FileKind kind, uint64_t frame_id) const;

  // One for each kind of file: file_unreadable.
  std::vector<Diagnostic> Diagnostics() const;
  // Ids of the frames that were not sent because their image is unreadable.
  const std::vector<uint64_t>& skipped_frames() const { return skipped_frames_; }

 private:
  struct Kind {
    size_t listed = 0, unreadable = 0;
    uint64_t first_frame_id = 0;
    std::string first_reason;  // names the file
  };

  Diagnostic DiagnosticOf(files::FileKind kind) const;

  std::array<Kind, 3> kinds_;  // by files::FileKind
  std::vector<uint64_t> skipped_frames_;
};

}  // namespace romap::cli
