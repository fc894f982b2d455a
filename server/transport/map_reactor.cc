#include "server/transport/map_reactor.h"

#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "common/status.h"
#include "common/wire/frame.h"

namespace romap::transport {

absl::Status MapReactor::Run() {
  ROMAP_RETURN_IF_ERROR(ReadStart());
  const std::string session_id = request_.start().session_id();
  ROMAP_ASSIGN_OR_RETURN(const std::unique_ptr<MapStream> stream,
                         service().OpenMap(session_id, request_.start().resume_token()));

  std::thread pump([&] { PumpRequests(*stream); });
  // Guarded, so that the pump is joined in any case.
  const absl::Status status = Guarded([&] { return ForwardEvents(session_id, *stream); });
  RequestStop(status);  // wakes the pump if it waits for a request
  stream->Cancel();     // wakes the pump if it waits for the stream to accept one
  pump.join();
  // The call must not end earlier: the session accepts another stream only from here on.
  return status;
}

absl::Status MapReactor::ReadStart() {
  StartRead(&request_);
  const std::optional<bool> read = read_.WaitFor(first_request_timeout_);
  if (!read && !stopping()) {
    return absl::DeadlineExceededError(
        fmt::format("map: the first request, `start`, did not come within {} ms", first_request_timeout_.count()));
  }
  if (read.value_or(false) && request_.has_start()) return absl::OkStatus();
  return InvalidArgument("map: first request must be `start`");
}

void MapReactor::PumpRequests(MapStream& stream) {
  const absl::Status status = Guarded([&]() -> absl::Status {
    while (true) {
      const std::optional<bool> read = Read();
      if (!read) return absl::OkStatus();
      if (!*read) break;
      ROMAP_RETURN_IF_ERROR(HandleRequest(stream));
    }
    // Fails only if the stream is already being closed.
    stream.CloseSend().IgnoreError();
    return absl::OkStatus();
  });
  if (!status.ok()) RequestStop(status);
}

absl::Status MapReactor::HandleRequest(MapStream& stream) {
  if (request_.has_frame()) return HandleFrame(stream);
  if (request_.has_late_masks()) return HandleMasks(stream);
  return InvalidArgument("map: requests after the first must be `frame` or `late_masks`");
}

absl::Status MapReactor::HandleFrame(MapStream& stream) {
  const uint64_t frame_id = request_.frame().frame_id();
  auto frame = wire::FromProto(std::move(*request_.mutable_frame()));
  if (frame.ok()) return stream.Send(*std::move(frame));
  FrameAck ack;
  ack.frame_id = frame_id;
  ack.accepted = false;
  ack.error = Message(frame.status());
  WriteEvent(std::move(ack));
  return absl::OkStatus();
}

absl::Status MapReactor::HandleMasks(MapStream& stream) {
  const uint64_t frame_id = request_.late_masks().frame_id();
  auto masks = wire::FromProto(std::move(*request_.mutable_late_masks()));
  if (masks.ok()) return stream.SendMasks(*std::move(masks));
  WriteEvent(MasksAck{.frame_id = frame_id, .accepted = false, .error = Message(masks.status())});
  return absl::OkStatus();
}

void MapReactor::WriteEvent(MapEvent event) {
  v1::MapResponse response;
  *response.mutable_event() = wire::ToProto(std::move(event));
  Write(response);
}

std::optional<bool> MapReactor::Read() {
  StartRead(&request_);
  return read_.Wait();
}

}  // namespace romap::transport
