// Measures memory and time of a long session over one scene: they must not grow with its length.
//
//   long_session_bench SEQUENCE FRAMES [given|none] [STORE_DIR]
//
// Sends the frames of the sequence forward and backward, again and again, until FRAMES are sent, and prints the
// resident memory, the user time per frame of the process (with training) and the numbers of keyframes and points every
// 500 frames; at the end, what remains resident when the session is deleted. With STORE_DIR, the session is stored
// there.

#include <fmt/format.h>
#include <malloc.h>
#include <spdlog/spdlog.h>

#include <cstdlib>
#include <string>
#include <thread>

#include "client/files/sequence.h"
#include "common/status.h"
#include "server/session/local_mapping_service.h"
#include "tests/bench/user_seconds.h"

namespace romap::measure {
namespace {

constexpr size_t kPeriod = 500;

double Megabytes(uint64_t bytes) { return static_cast<double>(bytes) / 1e6; }

absl::Status Settle(MapStream& stream, uint64_t frame_id) {
  while (true) {
    const auto event = stream.Next(std::chrono::milliseconds(1000));
    if (!event && stream.Done()) return stream.status();
    const auto* ack = event ? std::get_if<FrameAck>(&*event) : nullptr;
    if (ack != nullptr && !ack->accepted) return Internal("frame {}: {}", ack->frame_id, ack->error);
    if (ack != nullptr && ack->frame_id == frame_id) return absl::OkStatus();
  }
}

absl::Status Measure(const std::string& dir, size_t frames, PoseUse pose_use, const std::string& store_dir) {
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence, files::Sequence::Open(dir));
  std::unique_ptr<store::Store> store;
  if (!store_dir.empty()) {
    store::StoreConfig config;
    config.data_dir = store_dir;
    ROMAP_ASSIGN_OR_RETURN(store, store::Store::Open(config));
  }
  session::LocalMappingService service(session::ServerConfig{}, std::move(store));
  SessionOptions options;
  options.camera = sequence.camera();
  options.pose_use = pose_use;
  ROMAP_ASSIGN_OR_RETURN(const SessionInfo session, service.CreateSession(options));
  ROMAP_ASSIGN_OR_RETURN(const SessionInfo idle, service.GetSession(session.id));
  ROMAP_ASSIGN_OR_RETURN(auto stream, service.OpenMap(session.id));
  fmt::print("{:>7} {:>12} {:>14} {:>10} {:>8} {:>8}\n", "frame", "memory [MB]", "user [ms/frame]", "keyframes",
             "points", "objects");
  const size_t cycle = 2 * (sequence.size() - 1);
  double user_s = UserSeconds();
  for (size_t i = 0; i < frames; ++i) {
    const size_t step = i % cycle;
    std::vector<files::UnreadableFile> unreadable;
    ROMAP_ASSIGN_OR_RETURN(FrameInput frame,
                           sequence.LoadReadable(step < sequence.size() ? step : cycle - step, &unreadable));
    frame.frame_id = i + 1;
    frame.timestamp_ns = static_cast<int64_t>(i + 1) * 40'000'000;
    ROMAP_RETURN_IF_ERROR(stream->Send(std::move(frame)));
    ROMAP_RETURN_IF_ERROR(Settle(*stream, i + 1));
    if ((i + 1) % kPeriod != 0) continue;
    ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service.GetSession(session.id));
    const double now_s = UserSeconds();
    fmt::print("{:>7} {:>12.0f} {:>14.1f} {:>10} {:>8} {:>8}\n", i + 1, Megabytes(info.statistics.resident_bytes),
               1000 * (now_s - user_s) / kPeriod, info.statistics.keyframes, info.statistics.map_points,
               info.statistics.objects);
    std::fflush(stdout);
    user_s = now_s;
  }
  ROMAP_RETURN_IF_ERROR(service.DeleteSession(session.id));
  stream = nullptr;
  ROMAP_ASSIGN_OR_RETURN(const SessionInfo empty, service.CreateSession(options));
  fmt::print("{:>7} {:>12.0f} ({:.0f} before the first frame)\n", "deleted", Megabytes(empty.statistics.resident_bytes),
             Megabytes(idle.statistics.resident_bytes));
  return absl::OkStatus();
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: long_session_bench SEQUENCE FRAMES [given|none] [STORE_DIR]\n");
    return 2;
  }
  spdlog::set_level(spdlog::level::warn);
  const bool given = argc < 4 || std::string(argv[3]) != "none";
  const absl::Status status =
      romap::measure::Measure(argv[1], static_cast<size_t>(std::atoll(argv[2])),
                              given ? romap::PoseUse::kGiven : romap::PoseUse::kIgnore, argc > 4 ? argv[4] : "");
  if (!status.ok()) fmt::print(stderr, "long_session_bench: {}\n", romap::Message(status));
  return status.ok() ? 0 : 1;
}
