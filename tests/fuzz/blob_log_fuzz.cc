// The store's files after a crash or with damage: a segment of blobs, where a catalog says that the blobs are, and the
// content of the blobs.

#include <cstring>

#include "server/store/blob_content.h"
#include "server/store/blob_log.h"
#include "server/store/content_hash.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/fuzz/scratch_folder.h"
#include "tests/support/streams.h"

namespace romap::fuzz::blob_log_fuzz {
namespace {

constexpr size_t kNumbersBytes = 16;

std::string Numbers(uint64_t offset, uint64_t length) {
  std::string bytes(kNumbersBytes, '\0');
  std::memcpy(bytes.data(), &offset, 8);
  std::memcpy(bytes.data() + 8, &length, 8);
  return bytes;
}

void ParseContent(const std::string& content) {
  const auto input = store::ParseInput(content);
  if (input.ok()) (void)store::InputContent(*input);
  const auto object = store::ParseObject(content);
  if (object.ok()) (void)store::ObjectContent(*object);
  const auto mesh = store::ParseMesh(content);
  if (mesh.ok()) (void)store::MeshContent(*mesh);
  std::vector<FrameAck> frames;
  std::vector<int64_t> timestamps_ns;
  if (store::ParseTrajectory(content, &frames, &timestamps_ns).ok()) {
    Require(frames.size() == timestamps_ns.size(), "every pose has a time");
  }
}

}  // namespace
}  // namespace romap::fuzz::blob_log_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  FrameInput frame = testing_support::MakeFrame(1, "mug");
  frame.image = "raw";
  ObjectUpdate object;
  object.id = ObjectId{4};
  MeshUpdate mesh;
  mesh.id = ObjectId{4};
  FrameAck ack;
  ack.T_world_camera.emplace();
  std::vector<std::string> seeds;
  for (const std::string& content : {store::InputContent(frame), store::ObjectContent(object), store::MeshContent(mesh),
                                     store::TrajectoryContent({ack}, {5})}) {
    const ScratchFolder folder;
    store::BlobLog log(folder.path(), 0, 0);
    const store::BlobRef blob = log.Append(content);
    Require(log.Sync().ok(), "a blob can be written");
    seeds.push_back(blob_log_fuzz::Numbers(blob.offset, blob.length) + folder.Read("000000.seg"));
  }
  return seeds;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  using fuzz::blob_log_fuzz::kNumbersBytes;
  if (size < kNumbersBytes) return 0;
  static const fuzz::ScratchFolder folder;
  const std::string segment = fuzz::TextOf(data + kNumbersBytes, size - kNumbersBytes);
  folder.Write("000000.seg", segment);
  store::BlobRef blob;
  std::memcpy(&blob.offset, data, 8);
  std::memcpy(&blob.length, data + 8, 8);
  // The hash of what is there, so that the content is read, too.
  const uint64_t begin = std::min<uint64_t>(segment.size(), blob.EndOffset() - blob.length);
  blob.hash = store::HashOf(std::string_view(segment).substr(begin, blob.length));
  const auto content = store::BlobLog::Read(folder.path(), blob);
  if (!content.ok()) return 0;
  fuzz::Require(content->size() == blob.length, "a blob has the stated length");
  fuzz::blob_log_fuzz::ParseContent(*content);
  return 0;
}
