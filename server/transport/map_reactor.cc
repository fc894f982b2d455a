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

  std::thread pump([&] { PumpRequests(*stream); });
  // Whatever goes wrong, the pump must be joined before this function is left.
  const absl::Status status = Guarded([&] { return ForwardEvents(session_id, *stream); });
  RequestStop(status);  // wakes the pump where it waits for a request,
  stream->Cancel();     // and where it waits for room
  pump.join();
  // Only now, with the session free for another stream, may the client learn that this one is over.
  return status;
}

void MapReactor::PumpRequests(MapStream& stream) {
  const absl::Status status = Guarded([&]() -> absl::Status {
    while (true) {
      const std::optional<bool> read = Read();
      if (!read) return absl::OkStatus();
      if (!*read) break;
      ROMAP_RETURN_IF_ERROR(TakeRequest(stream));
    }
    // Fails only when the stream is being closed anyway.
    stream.CloseSend().IgnoreError();
    return absl::OkStatus();
  });
  if (!status.ok()) RequestStop(status);
}

absl::Status MapReactor::TakeRequest(MapStream& stream) {
  if (request_.has_frame()) return TakeFrame(stream);
  if (request_.has_late_masks()) return TakeMasks(stream);
  return InvalidArgument("map: every request after the first must be `frame` or `late_masks`");
}

absl::Status MapReactor::TakeFrame(MapStream& stream) {
  const uint64_t frame_id = request_.frame().frame_id();
  auto frame = wire::FromProto(std::move(*request_.mutable_frame()));
  if (frame.ok()) return stream.Send(*std::move(frame));
  FrameAck refusal;
  refusal.frame_id = frame_id;
  refusal.accepted = false;
  refusal.error = Message(frame.status());
  Answer(std::move(refusal));
  return absl::OkStatus();
}

absl::Status MapReactor::TakeMasks(MapStream& stream) {
  const uint64_t frame_id = request_.late_masks().frame_id();
  auto masks = wire::FromProto(std::move(*request_.mutable_late_masks()));
  if (masks.ok()) return stream.SendMasks(*std::move(masks));
  Answer(MasksAck{.frame_id = frame_id, .accepted = false, .error = Message(masks.status())});
  return absl::OkStatus();
}

void MapReactor::Answer(MapEvent refusal) {
  v1::MapResponse response;
  *response.mutable_event() = wire::ToProto(std::move(refusal));
  Write(response);
}

std::optional<bool> MapReactor::Read() {
  StartRead(&request_);
  return read_.Wait();
}

}  // namespace romap::transport
