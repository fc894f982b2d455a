// Trajectories in the TUM format, and their uncertainties.

#include "client/files/pose_uncertainty_file.h"
#include "client/files/tum.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/scratch_folder.h"

std::vector<std::string> romap::fuzz::Seeds() {
  return {"# t x y z qx qy qz qw\n0.1 1 2 3 0 0 0 1\n0.2 1 2 3.5 0 0 0.7071 0.7071\n",
          "1305031102.1758 1 2 3 0 0 0 1\n1305031102.2758 -1e-3 2 +3 0.5 0.5 0.5 0.5 # end\n",
          "1305031102175811023 1 2 3 0 0 0 1\r\n1305031102275811023 1 2 3 0 0 0 -1\r\n",
          "0.1 0.01 0.02\n0.2 0.03 1e-4\n"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  const std::string path = folder.Write("trajectory.txt", fuzz::TextOf(data, size));
  std::vector<files::StampedPose> poses(1);
  poses[0].timestamp_ns = 100'000'000;
  (void)files::ReadUncertainties(path, &poses);

  files::TimeUnit unit = files::TimeUnit::kSeconds;
  const auto read = files::ReadTum(path, &unit);
  if (!read.ok()) return 0;
  fuzz::Require(!read->empty(), "a trajectory has poses");
  for (const files::StampedPose& pose : *read) {
    fuzz::Require(pose.T_world_camera.IsFinite(), "poses are finite");
    for (const int64_t offset_ns : {0, 1, 1'000'000}) {
      if (pose.timestamp_ns < INT64_MAX - offset_ns) {
        (void)files::PoseAt(*read, pose.timestamp_ns + offset_ns, 20'000'000);
      }
    }
  }
  // A trajectory far from the epoch is written with the same times.
  fuzz::Require(files::WriteTum(folder.Path("copy.txt"), *read).ok(), "a trajectory can be written");
  return 0;
}
