#include "server/http/frame_feeds.h"

#include <charconv>
#include <utility>

#include "common/status.h"
#include "common/wire/events.h"
#include "server/http/json.h"

namespace romap::http {
namespace {

constexpr size_t kMaxFrames = 2;
constexpr std::chrono::seconds kIdle{30};
constexpr std::chrono::seconds kMaxWait{20};  // for an acknowledgment

template <class Number>
absl::StatusOr<Number> ParseQueryNumber(const HttpRequest& request, const char* name) {
  const auto found = request.query.find(name);
  if (found == request.query.end()) return InvalidArgument("{}: missing in the query", name);
  const std::string& text = found->second;
  Number value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return InvalidArgument("{}: must be a number", name);
  return value;
}

absl::StatusOr<FrameInput> ToFrame(HttpRequest& request) {
  FrameInput frame;
  ROMAP_ASSIGN_OR_RETURN(frame.frame_id, ParseQueryNumber<uint64_t>(request, "frame_id"));
  ROMAP_ASSIGN_OR_RETURN(frame.timestamp_ns, ParseQueryNumber<int64_t>(request, "timestamp_ns"));
  frame.image_encoding = ImageEncoding::kJpeg;
  frame.image = std::move(request.body);
  return frame;
}

}  // namespace

FrameFeeds::~FrameFeeds() {
  for (auto& [key, feed] : feeds_) Close(feed, absl::UnavailableError("the server is shutting down"));
}

void FrameFeeds::Post(const std::string& session_id, HttpRequest request, std::unique_ptr<Exchange> exchange) {
  absl::StatusOr<FrameInput> frame = ToFrame(request);
  if (!frame.ok()) return exchange->Respond(ErrorResponse(frame.status()));
  const Key key(session_id, request.authorization);
  Feed& feed = feeds_[key];
  if (feed.is_sending || feed.frames.size() >= kMaxFrames) {
    return exchange->Respond(
        ErrorResponse(absl::ResourceExhaustedError("earlier frames of the session are still being processed")));
  }
  if (feed.number == 0) feed.number = ++feeds_opened_;
  const uint64_t frame_id = frame->frame_id, number = feed.number;
  if (feed.frames.contains(frame_id)) {
    return exchange->Respond(ErrorResponse(InvalidArgument("frame_id: frame {} is being processed", frame_id)));
  }
  feed.frames[frame_id] = {.exchange = std::move(exchange), .since = Clock::now()};
  feed.last_used = Clock::now();
  feed.is_sending = true;
  auto shared_frame = std::make_shared<FrameInput>(*std::move(frame));
  const bool is_submitted = pool_->Submit([this, key, number, frame_id, stream = feed.stream, shared_frame]() mutable {
    Sent sent = Send(key, std::move(stream), std::move(*shared_frame));
    loop_->Post([this, key, number, frame_id, sent = std::move(sent)]() mutable {
      OnSent(key, number, frame_id, std::move(sent));
    });
  });
  if (!is_submitted) {
    OnSent(key, number, frame_id, {feed.stream, absl::ResourceExhaustedError("the server has too many requests")});
  }
}

FrameFeeds::Sent FrameFeeds::Send(const Key& key, std::shared_ptr<MapStream> stream, FrameInput frame) const {
  const auto& [session_id, authorization] = key;
  const absl::StatusOr<access::Caller> caller = authenticator_->Authenticate(authorization);
  if (!caller.ok()) return {std::move(stream), caller.status()};
  if (!stream) {
    const absl::StatusOr<SessionInfo> info = caller->service->GetSession(session_id);
    if (!info.ok()) return {nullptr, info.status()};
    if (info->mode != FrameMode::kLive) {
      // Sending into a replay session blocks until it has space.
      return {nullptr, FailedPrecondition("frames over HTTP need a session with the mode FRAME_MODE_LIVE")};
    }
    absl::StatusOr<std::unique_ptr<MapStream>> opened = caller->service->OpenMap(session_id);
    if (!opened.ok()) return {nullptr, opened.status()};
    stream = *std::move(opened);
  }
  const absl::Status status = stream->Send(std::move(frame));
  return {std::move(stream), status};
}

void FrameFeeds::OnSent(const Key& key, uint64_t number, uint64_t frame_id, Sent sent) {
  const auto found = feeds_.find(key);
  if (found == feeds_.end() || found->second.number != number) {
    return pool_->Dispose([stream = std::move(sent.stream)]() mutable { stream.reset(); });
  }
  Feed& feed = found->second;
  feed.is_sending = false;
  feed.stream = std::move(sent.stream);
  if (sent.status.ok()) return;
  if (const auto frame = feed.frames.find(frame_id); frame != feed.frames.end()) {
    frame->second.exchange->Respond(ErrorResponse(sent.status));
    feed.frames.erase(frame);
  }
  if (feed.stream && !absl::IsUnauthenticated(sent.status)) return;
  Close(feed, sent.status);
  feeds_.erase(found);
}

void FrameFeeds::Pump() {
  const Clock::time_point now = Clock::now();
  for (auto entry = feeds_.begin(); entry != feeds_.end();) {
    Feed& feed = entry->second;
    if (feed.is_sending && !feed.stream) {  // it is being opened
      ++entry;
    } else if (!Pump(feed, now)) {
      absl::Status status = feed.stream->status();
      if (status.ok()) status = FailedPrecondition("the session accepts no more frames");
      Close(feed, status);
      entry = feeds_.erase(entry);
    } else if (!feed.is_sending && feed.frames.empty() && now - feed.last_used > kIdle) {
      Close(feed, absl::OkStatus());
      entry = feeds_.erase(entry);
    } else {
      ++entry;
    }
  }
}

bool FrameFeeds::Pump(Feed& feed, Clock::time_point now) {
  while (true) {
    std::optional<MapEvent> event = feed.stream->Next(std::chrono::milliseconds(0));
    if (!event) break;
    auto* ack = std::get_if<FrameAck>(&*event);
    if (ack == nullptr) continue;
    const auto frame = feed.frames.find(ack->frame_id);
    if (frame == feed.frames.end()) continue;
    frame->second.exchange->Respond(JsonResponse(ToJson(wire::ToProto(std::move(*ack)))));
    feed.frames.erase(frame);
  }
  std::erase_if(feed.frames, [&](auto& entry) {
    if (now - entry.second.since < kMaxWait) return false;
    entry.second.exchange->Respond(
        ErrorResponse(absl::DeadlineExceededError("the frame was not processed in time; it may be later")));
    return true;
  });
  return !feed.stream->Done();
}

void FrameFeeds::Close(Feed& feed, const absl::Status& reason) {
  for (auto& [frame_id, frame] : feed.frames) frame.exchange->Respond(ErrorResponse(reason));
  feed.frames.clear();
  if (feed.stream) pool_->Dispose([stream = std::move(feed.stream)]() mutable { stream.reset(); });
}

}  // namespace romap::http
