#pragma once

#include <cstddef>
#include <string>

#include "client/files/sequence.h"
#include "client/importers/recording_contents.h"
#include "common/status.h"

namespace romap::importers {

// How a recording is read. README.md describes the layouts.
struct ReadOptions {
  double fps = 0;       // of recordings without timestamps; 0: 30
  double focal_px = 0;  // replaces fx and fy; 0: those of the recording, or a guess
  size_t every = 1;     // takes every n-th frame
  files::SequenceOptions files = {};
};

// Reads recordings of one layout. Stateless.
class SequenceReader {
 public:
  virtual ~SequenceReader() = default;

  // The layout, as in "read as a COLMAP model".
  virtual std::string Name() const = 0;
  // The files by which Fits() recognizes the layout, for messages.
  virtual std::string Expected() const = 0;
  // Whether the file or folder has this layout, by its content.
  virtual bool Fits(const std::string& source) const = 0;
  // Reads everything but the images. Poses are camera to world, with x right, y down, z forward. INVALID_ARGUMENT and
  // NOT_FOUND name the file and what would be right.
  virtual absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const = 0;
};

}  // namespace romap::importers
