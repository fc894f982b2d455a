#pragma once

#include <romap/client/sdk/remote_mapping_service.h>
#include <romap/client/sdk/resuming_map_stream.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>

// What both examples do: a session that survives breaks of the connection, whose events are printed by a thread.
class Feed {
 public:
  Feed(romap::MappingService& server, const romap::SessionOptions& options, bool is_live) : server_(server) {
    session_ = Check(server.CreateSession(options)).id;
    romap::client::ResumeOptions resume;
    resume.drop_oldest = is_live;
    if (is_live) resume.max_waiting = 8;
    resume.on_link = [](bool up, const std::string& reason, int) {
      std::fprintf(stderr, "%s\n", up ? "the link is up again" : ("link lost, retrying: " + reason).c_str());
    };
    stream_ = Check(romap::client::ResumingMapStream::Open(&server, session_, resume));
    reader_ = std::thread([this] { Print(); });
  }

  void Send(romap::FrameInput frame) { Check(stream_->Send(std::move(frame))); }

  // Trains the objects to completion and returns their map.
  romap::MapSnapshot Finish() {
    // A restarted server could not get frames again that it lost if the session were finished before.
    while (stream_->unsettled() > 0 && !stream_->Done()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    Check(server_.FinishSession(session_));
    reader_.join();
    Check(stream_->status());
    return Check(server_.ExportMap(session_));
  }

  // The value, or the end of the program with the reason.
  template <class T>
  static T Check(absl::StatusOr<T> value) {
    Check(value.status());
    return *std::move(value);
  }
  static void Check(const absl::Status& status) {
    if (status.ok()) return;
    std::fprintf(stderr, "%s\n", status.ToString().c_str());
    std::_Exit(1);
  }

 private:
  void Print() {
    while (!stream_->Done()) {
      const auto event = stream_->Next(std::chrono::milliseconds(200));
      if (!event) continue;
      if (const auto* ack = std::get_if<romap::FrameAck>(&*event); ack != nullptr && !ack->accepted) {
        std::printf("frame %llu was rejected: %s\n", static_cast<unsigned long long>(ack->frame_id),
                    ack->error.c_str());
      } else if (const auto* diagnostic = std::get_if<romap::Diagnostic>(&*event)) {
        std::printf("%s\n", diagnostic->text.c_str());
      }
    }
  }

  romap::MappingService& server_;
  std::string session_;
  std::unique_ptr<romap::client::ResumingMapStream> stream_;
  std::thread reader_;
};

inline void PrintObjects(const romap::MapSnapshot& map) {
  for (const romap::ObjectSnapshot& each : map.objects) {
    const Eigen::Vector3d size = 2 * each.object.cuboid.half_extents;
    std::printf("%s: %.3f x %.3f x %.3f, %u triangles\n", each.object.class_name.c_str(), size.x(), size.y(), size.z(),
                each.mesh ? static_cast<unsigned>(each.mesh->triangle_count) : 0U);
  }
}
