#pragma once

#include <string>
#include <vector>

#include "client/cli/run_stream.h"
#include "client/files/sequence.h"
#include "client/importers/sequence_reader.h"

namespace CLI {
class App;
}

namespace romap::cli {

// The arguments that select a recorded sequence and say how its files are read.
struct SequenceArguments {
  std::string dir;  // a folder or a video file
  importers::ReadOptions read;
  PoseUse poses = PoseUse::kGiven;
  std::vector<std::string> conventions;
  std::string pose_offset;
  std::string up;          // "x" to "-z", "auto"; empty: that of the sequence
  double readout_ms = -1;  // < 0: that of the sequence

  // The arguments that select the recording.
  void AddSourceTo(CLI::App& app);
  // Those that say how it is mapped.
  void AddUseTo(CLI::App& app);
  // Opens the recording, of any known layout. INVALID_ARGUMENT: --pose-convention or --pose-offset is malformed.
  // Otherwise as OpenRecording.
  absl::StatusOr<files::Sequence> Open() const;
  // Sets the use of the poses, and up.
  void SetPoseUse(const files::Sequence& sequence, StreamOptions* stream) const;
};

}  // namespace romap::cli
