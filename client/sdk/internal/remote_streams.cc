#include "client/sdk/internal/remote_streams.h"

#include <utility>

#include "common/status.h"
#include "common/wire/frame.h"

namespace romap::client {

absl::StatusOr<std::unique_ptr<EventStream>> RemoteWatchStream::Open(std::shared_ptr<v1::Mapping::Stub> stub,
                                                                     const std::string& session_id,
                                                                     std::chrono::milliseconds timeout) {
  std::unique_ptr<RemoteWatchStream> stream(new RemoteWatchStream(std::move(stub)));
  stream->request_.set_session_id(session_id);
  stream->stub_->async()->Watch(stream->reactor_.context(), &stream->request_, &stream->reactor_);
  ROMAP_RETURN_IF_ERROR(stream->reactor_.Begin(timeout));
  return stream;
}

absl::StatusOr<std::unique_ptr<MapStream>> RemoteMapStream::Open(std::shared_ptr<v1::Mapping::Stub> stub,
                                                                 const std::string& session_id,
                                                                 const std::string& resume_token,
                                                                 std::chrono::milliseconds timeout,
                                                                 int max_message_bytes) {
  std::unique_ptr<RemoteMapStream> stream(new RemoteMapStream(std::move(stub), max_message_bytes));
  stream->stub_->async()->Map(stream->reactor_.context(), &stream->reactor_);
  stream->reactor_.QueueStart(session_id, resume_token);
  ROMAP_RETURN_IF_ERROR(stream->reactor_.Begin(timeout));
  return stream;
}

void RemoteMapStream::Reactor::QueueStart(const std::string& session_id, const std::string& resume_token) {
  request_.mutable_start()->set_session_id(session_id);
  request_.mutable_start()->set_resume_token(resume_token);
  write_pending_ = true;
  StartWrite(&request_);
}

absl::Status RemoteMapStream::Reactor::Send(FrameInput frame) {
  FrameAck rejection;
  rejection.frame_id = frame.frame_id;
  v1::MapRequest request;
  *request.mutable_frame() = wire::ToProto(std::move(frame));
  return SendRequest(std::move(request), std::move(rejection));
}

absl::Status RemoteMapStream::Reactor::SendMasks(MasksInput masks) {
  MasksAck rejection;
  rejection.frame_id = masks.frame_id;
  v1::MapRequest request;
  *request.mutable_late_masks() = wire::ToProto(std::move(masks));
  return SendRequest(std::move(request), std::move(rejection));
}

template <class Ack>
absl::Status RemoteMapStream::Reactor::SendRequest(v1::MapRequest request, Ack rejection) {
  std::lock_guard sending(send_mutex_);
  if (send_closed_) return FailedPrecondition("CloseSend() was already called on this stream");
  ROMAP_RETURN_IF_ERROR(WaitForWrite());
  const size_t bytes = request.ByteSizeLong();
  if (bytes > static_cast<size_t>(max_message_bytes_)) {
    rejection.accepted = false;
    rejection.error = fmt::format("message has {} bytes; the limit is {}", bytes, max_message_bytes_);
    Deliver(std::move(rejection));
    return absl::OkStatus();
  }
  request_ = std::move(request);
  {
    std::lock_guard lock(write_mutex_);
    write_pending_ = true;
  }
  if (!HoldUnlessEnded()) {
    OnWriteDone(false);
    return WaitForWrite();
  }
  StartWrite(&request_);
  RemoveHold();
  return WaitForWrite();
}

absl::Status RemoteMapStream::Reactor::CloseSend() {
  std::lock_guard sending(send_mutex_);
  if (send_closed_) return FailedPrecondition("CloseSend() was already called on this stream");
  ROMAP_RETURN_IF_ERROR(WaitForWrite());
  if (!HoldUnlessEnded()) return EndStatus();
  send_closed_ = true;
  StartWritesDone();
  RemoveHold();
  return absl::OkStatus();
}

void RemoteMapStream::Reactor::OnWriteDone(bool ok) {
  std::lock_guard lock(write_mutex_);
  write_pending_ = false;
  write_failed_ = write_failed_ || !ok;
  write_changed_.notify_all();
}

absl::Status RemoteMapStream::Reactor::WaitForWrite() {
  {
    std::unique_lock lock(write_mutex_);
    write_changed_.wait(lock, [&] { return !write_pending_; });
    if (!write_failed_) return absl::OkStatus();
  }
  const absl::Status status = EndStatus();
  return status.ok() ? FailedPrecondition("the server closed the stream and accepts no more frames") : status;
}

}  // namespace romap::client
