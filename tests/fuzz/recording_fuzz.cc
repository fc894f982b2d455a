// Recordings of sessions, for `romap replay`.

#include <filesystem>

#include "common/wire/recording.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/fuzz/scratch_folder.h"
#include "tests/support/streams.h"

std::vector<std::string> romap::fuzz::Seeds() {
  const ScratchFolder folder;
  SessionOptions options;
  options.name = "kitchen";
  options.camera = testing_support::SmallCamera();
  {
    auto writer = wire::RecordingWriter::Create(folder.Path("a"), options).value();
    FrameInput frame = testing_support::MakeFrame(1, "mug");
    frame.image = "raw";
    MasksInput masks;
    masks.frame_id = 1;
    static_cast<EncodedMasks&>(masks) = frame;
    Require(writer->Append(frame).ok() && writer->Append(masks).ok(), "a recording can be written");
  }
  std::string recording = folder.Read("a");
  std::string first_version = recording;
  first_version[8] = 1;
  return {recording, first_version};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  static const fuzz::ScratchFolder folder;
  const std::string path = folder.Write("recording", fuzz::TextOf(data, size));
  const auto recording = wire::Recording::Open(path);
  if (!recording.ok()) return 0;
  fuzz::Require(recording->lost_bytes() <= size, "no more is lost than there is");
  fuzz::Require(recording->frames() <= recording->size(), "frames are inputs");
  for (size_t k = 0; k < recording->size(); ++k) (void)recording->Load(k);
  return 0;
}
