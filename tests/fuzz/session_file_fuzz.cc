// Session files (*.romap) that are loaded into a server. The first byte is the size of the pieces in which the file
// arrives. If it is odd, the file follows; otherwise the records without their hashes, which mutations would make
// wrong: the kind in one byte and the content, divided as in parts.h.

#include "common/wire/sessions.h"
#include "server/store/blob_content.h"
#include "server/store/session_file.h"
#include "server/store/session_transfer.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/parts.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/fuzz/scratch_folder.h"
#include "tests/support/streams.h"

namespace romap::fuzz::session_file_fuzz {
namespace {

std::string Part(store::FileRecord kind, const std::string& content) { return static_cast<char>(kind) + content; }

std::string FileOf(const std::vector<std::string>& parts) {
  std::string file = store::SessionFileHeader();
  for (const std::string& part : parts) {
    if (!part.empty()) file += store::SessionFileRecord(static_cast<store::FileRecord>(part[0]), part.substr(1));
  }
  return file;
}

std::vector<std::string> SampleParts() {
  SessionOptions options;
  options.name = "kitchen";
  options.camera = testing_support::SmallCamera();
  SessionInfo info;
  info.id = "a";
  info.name = "kitchen";
  info.camera = options.camera;
  info.state = SessionState::kFinished;
  FrameInput frame = testing_support::MakeFrame(1, "mug");
  frame.image = "raw";
  ObjectUpdate object;
  object.id = ObjectId{4};
  MeshUpdate mesh;
  mesh.id = ObjectId{4};
  mesh.draco = "mesh";
  FrameAck ack;
  ack.frame_id = 1;
  ack.T_world_camera.emplace();
  using enum store::FileRecord;
  return {Part(kSession, wire::ToProto(options).SerializeAsString()),
          Part(kState, wire::ToProto(info).SerializeAsString()),
          Part(kInput, store::InputContent(frame)),
          Part(kObject, store::ObjectContent(object)),
          Part(kMesh, store::MeshContent(mesh)),
          Part(kTrajectory, store::TrajectoryContent({ack}, {77})),
          Part(kEnd, "")};
}

class Loader {
 public:
  Loader() {
    store::StoreConfig config;
    config.data_dir = folder_.path();
    config.commit_period_s = 0;
    store_ = store::Store::Open(config).value();
  }

  void Load(const std::string& file, size_t piece_bytes) {
    size_t begin = 0;
    const auto loaded = store::LoadSession(*store_, "b", "lab", [&]() -> absl::StatusOr<std::string> {
      const std::string piece = file.substr(std::min(begin, file.size()), piece_bytes);
      begin += piece_bytes;
      return piece;
    });
    const auto sessions = store_->Sessions();
    Require(sessions.ok() && sessions->size() == (loaded.ok() ? 1 : 0), "nothing remains of a refused session");
    if (!loaded.ok()) return;
    Require(store_->Flush().ok(), "a session that was loaded can be stored");
    (void)store_->LoadMap("b");
    for (uint64_t number = 1; number <= loaded->inputs; ++number) (void)store_->LoadInput("b", number);
    std::string saved;
    (void)store::SaveSession(*store_, "b", [&](const std::string& piece) {
      saved += piece;
      return absl::OkStatus();
    });
    Require(store_->Remove("b").ok(), "a session that was loaded can be removed");
  }

 private:
  ScratchFolder folder_;
  std::unique_ptr<store::Store> store_;
};

}  // namespace
}  // namespace romap::fuzz::session_file_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  const std::vector<std::string> parts = session_file_fuzz::SampleParts();
  std::string file = session_file_fuzz::FileOf(parts);
  return {'\x80' + JoinParts(parts), '\x81' + file, '\x03' + file};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap::fuzz;
  if (size == 0) return 0;
  static session_file_fuzz::Loader loader;
  std::string file = TextOf(data + 1, size - 1);
  if (data[0] % 2 == 0) file = session_file_fuzz::FileOf(SplitParts(file));
  loader.Load(file, 1 + data[0]);
  return 0;
}
