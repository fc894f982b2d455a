#include "server/transport/map_reactor.h"

#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "common/status.h"
#include "common/wire/frame.h"

namespace romap::transport {

absl::Status MapReactor::Run() {
  if (!Read().value_or(false) || !request_.has_start()) {
    return InvalidArgument("map: the first request must be `start`");
  }
  const std::string session_id = request_.start().session_id();
  ROMAP_ASSIGN_OR_RETURN(const std::unique_ptr<MapStream> stream, service().OpenMap(session_id));

  std::thread frame_pump([&] { PumpFrames(*stream); });
  // Whatever goes wrong, the pump must be joined before this function is left.
  const absl::Status status = Guarded([&] { return ForwardEvents(session_id, *stream); });
  RequestStop(status);  // wakes the pump where it waits for a frame,
  stream->Cancel();     // and where it waits for room
  frame_pump.join();
  // Only now, with the session free for another stream, may the client learn that this one is over.
  return status;
}

void MapReactor::PumpFrames(MapStream& stream) {
  const absl::Status status = Guarded([&]() -> absl::Status {
    while (true) {
      const std::optional<bool> read = Read();
      if (!read) return absl::OkStatus();
      if (!*read) break;
      ROMAP_RETURN_IF_ERROR(TakeFrame(stream));
    }
    // Fails only when the stream is being closed anyway.
    stream.CloseSend().IgnoreError();
    return absl::OkStatus();
  });
  if (!status.ok()) RequestStop(status);
}

absl::Status MapReactor::TakeFrame(MapStream& stream) {
  if (!request_.has_frame()) return InvalidArgument("map: every request after the first must be `frame`");
  const uint64_t frame_id = request_.frame().frame_id();
  auto frame = wire::FromProto(std::move(*request_.mutable_frame()));
  if (frame.ok()) return stream.Send(*std::move(frame));
  Refuse(frame_id, frame.status());
  return absl::OkStatus();
}

void MapReactor::Refuse(uint64_t frame_id, const absl::Status& why) {
  FrameAck ack;
  ack.frame_id = frame_id;
  ack.accepted = false;
  ack.error = Message(why);
  v1::MapResponse response;
  *response.mutable_event() = wire::ToProto(MapEvent(std::move(ack)));
  Write(response);
}

std::optional<bool> MapReactor::Read() {
  StartRead(&request_);
  return read_.Wait();
}

}  // namespace romap::transport
