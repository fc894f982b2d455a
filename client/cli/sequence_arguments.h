#pragma once

#include <string>
#include <vector>

#include "client/cli/run_stream.h"
#include "client/files/sequence.h"

namespace CLI {
class App;
}

namespace romap::cli {

// The arguments that select a recorded sequence and say how its files are read.
struct SequenceArguments {
  std::string dir;
  files::SequenceOptions file_options;
  PoseUse poses = PoseUse::kGiven;
  std::vector<std::string> conventions;
  std::string pose_offset;
  std::string up;          // "x" to "-z", "auto"; empty: the default
  double readout_ms = -1;  // < 0: that of the sequence

  void AddTo(CLI::App& app);
  // INVALID_ARGUMENT: --pose-convention or --pose-offset is malformed.
  absl::StatusOr<files::SequenceOptions> FileOptions() const;
  // Sets the use of the poses, and up.
  void SetPoseUse(StreamOptions* stream) const;
};

}  // namespace romap::cli
