#include "client/sdk/resuming_map_stream.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "client/sdk/internal/link_opener.h"
#include "client/sdk/internal/seen_objects.h"
#include "client/sdk/internal/unsettled_inputs.h"
#include "common/status.h"

namespace romap::client {

// Two threads: the receiver opens the streams and reads their events; the sender sends the inputs on the stream that
// is open. The receiver alone decides that a stream has ended.
class ResumingMapStream::Impl {
 public:
  Impl(MappingService* service, const std::string& session_id, const ResumeOptions& options)
      : options_(options), delays_(options.retry), opener_(service, session_id) {}
  ~Impl();

  absl::Status Start();

  const StreamOpening& opening() const { return opening_; }
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout);
  bool Done() const;
  absl::Status status() const;
  void Cancel();
  absl::Status Send(SessionInput input);
  absl::Status CloseSend();
  uint64_t dropped() const;
  size_t unsettled() const;
  bool all_answered() const;

 private:
  using Clock = std::chrono::steady_clock;
  using Link = LinkOpener::Link;
  static constexpr size_t kMaxEvents = 256;

  absl::StatusOr<Link> Establish(absl::Status broken);
  bool MayTryAgain() const;
  absl::Status GiveUp(const absl::Status& failure) const;
  void BeginLink(const Link& link);
  absl::Status Receive(EventStream& stream);
  void Process(MapEvent event, std::vector<MapEvent>* deliver);
  bool Deliver(std::vector<MapEvent> events);
  void RunReceiver();
  void End(absl::Status status);

  void RunSender();
  bool HasWork() const;
  absl::Status SendOne(MapStream& stream, const UnsettledInputs::Outgoing& outgoing);
  void OnSendFailed(MapStream& stream, const absl::Status& failure);
  absl::Status CheckSending() const;
  bool IsFull(size_t bytes) const;
  void DropToFit();
  void DropExpired();
  void NoteDropped(uint64_t frame_id, const char* reason);

  const ResumeOptions options_;
  // The receiver's, or the caller's before the threads start.
  RetryDelays delays_;
  LinkOpener opener_;
  std::optional<Clock::time_point> down_since_;  // the first break of the link since the last progress
  StreamOpening opening_;                        // constant once the threads run

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Link link_;                 // empty while the link is down
  bool send_failed_ = false;  // on the current link
  bool half_closed_ = false;  // the current link
  UnsettledInputs inputs_;
  SeenObjects seen_;
  std::deque<MapEvent> events_;
  absl::Status send_status_;  // not OK: the session accepts no more inputs, although its stream may go on
  bool closing_ = false;      // CloseSend() was called
  bool ended_ = false;
  absl::Status end_status_;
  uint64_t dropped_ = 0;

  std::thread receiver_, sender_;
};

ResumingMapStream::Impl::~Impl() {
  Cancel();
  if (receiver_.joinable()) receiver_.join();
  if (sender_.joinable()) sender_.join();
}

absl::Status ResumingMapStream::Impl::Start() {
  ROMAP_ASSIGN_OR_RETURN(const Link link, Establish(absl::OkStatus()));
  opening_ = link.events->opening();
  BeginLink(link);
  receiver_ = std::thread([this] { RunReceiver(); });
  sender_ = std::thread([this] { RunSender(); });
  return absl::OkStatus();
}

// ------------------------------------------------------------------------------------------------------- receiver

void ResumingMapStream::Impl::RunReceiver() {
  while (true) {
    Link link;
    {
      std::lock_guard lock(mutex_);
      if (ended_) return;
      link = link_;
    }
    const absl::Status broken = Receive(*link.events);
    if (broken.ok() || !opener_.MayReopen(broken)) return End(broken);
    {
      std::lock_guard lock(mutex_);
      if (ended_) return;
      link_ = {};
    }
    link = {};
    auto next = Establish(broken);
    if (!next.ok()) return End(next.status());
    BeginLink(*next);
  }
}

// Opens a stream, with further attempts. `broken`: how the last one ended; OK before the first one.
absl::StatusOr<LinkOpener::Link> ResumingMapStream::Impl::Establish(absl::Status broken) {
  absl::Status failure = broken;
  for (int attempt = 0;; ++attempt) {
    if (!failure.ok()) {
      if (!down_since_) down_since_ = Clock::now();
      if (options_.on_link) options_.on_link(false, Message(failure), attempt);
      // Short waits, so that Cancel() takes effect.
      const auto end = Clock::now() + delays_.Next();
      while (Clock::now() < end && MayTryAgain()) {
        WaitToRetry(std::chrono::milliseconds(20), end, options_.retry);
      }
      if (!MayTryAgain()) return GiveUp(failure);
    }
    LinkOpener::Kept kept;
    {
      std::lock_guard lock(mutex_);
      kept = {inputs_.Unacknowledged(), inputs_.NewestFrameId()};
    }
    LinkOpener::Attempt opened = opener_.Open(broken, kept);
    if (opened.status.ok()) {
      if (!failure.ok() && options_.on_link) options_.on_link(true, "", attempt);
      return std::move(opened.link);
    }
    if (!opened.retry) return opened.status;
    failure = opened.status;
  }
}

bool ResumingMapStream::Impl::MayTryAgain() const {
  {
    std::lock_guard lock(mutex_);
    if (ended_) return false;
  }
  if (options_.retry.keep_trying && !options_.retry.keep_trying()) return false;
  return Clock::now() < *down_since_ + options_.retry.max_down;
}

absl::Status ResumingMapStream::Impl::GiveUp(const absl::Status& failure) const {
  const std::chrono::duration<double> down = Clock::now() - *down_since_;
  return absl::Status(failure.code(), fmt::format("{} (gave up after {:.1f} s)", Message(failure), down.count()));
}

void ResumingMapStream::Impl::BeginLink(const Link& link) {
  std::vector<MapEvent> removals;
  {
    std::lock_guard lock(mutex_);
    if (ended_) return;
    inputs_.BeginStream(link.events->opening().durable);
    if (!link.inputs) {
      // Everything is on the server; see LinkOpener.
      inputs_.Clear();
      send_status_ = FailedPrecondition("the session was finished and accepts no more inputs");
    }
    if (inputs_.size() == 0) down_since_.reset();
    for (ObjectRemoved& removed : seen_.KeepOnly(link.events->opening().objects))
      removals.push_back(std::move(removed));
    link_ = link;
    send_failed_ = half_closed_ = false;
  }
  changed_.notify_all();
  Deliver(std::move(removals));
}

// Reads the stream to its end and returns its status.
absl::Status ResumingMapStream::Impl::Receive(EventStream& stream) {
  constexpr std::chrono::milliseconds kWait{200};
  while (true) {
    std::optional<MapEvent> event = stream.Next(kWait);
    if (!event) {
      if (stream.Done()) return stream.status();
      continue;
    }
    std::vector<MapEvent> deliver;
    Process(*std::move(event), &deliver);
    if (!Deliver(std::move(deliver))) return absl::CancelledError("the stream was canceled");
  }
}

void ResumingMapStream::Impl::Process(MapEvent event, std::vector<MapEvent>* deliver) {
  std::lock_guard lock(mutex_);
  const size_t before = inputs_.size();
  if (const auto* ack = std::get_if<FrameAck>(&event)) {
    inputs_.Acknowledge(*ack, deliver);
  } else if (const auto* masks = std::get_if<MasksAck>(&event)) {
    inputs_.Acknowledge(*masks, deliver);
  } else {
    if (const auto* durable = std::get_if<Durable>(&event)) inputs_.Cover(*durable);
    seen_.Note(event);
    deliver->push_back(std::move(event));
    if (inputs_.size() == before) return;
  }
  changed_.notify_all();
  if (inputs_.size() == before && deliver->empty()) return;
  // The server gets on with the inputs, so that a later break is a new one.
  down_since_.reset();
  delays_.Reset();
}

// Waits while the caller has many events to read. False if the stream has ended.
bool ResumingMapStream::Impl::Deliver(std::vector<MapEvent> events) {
  std::unique_lock lock(mutex_);
  for (MapEvent& event : events) {
    changed_.wait(lock, [&] { return ended_ || events_.size() < kMaxEvents; });
    if (ended_) return false;
    events_.push_back(std::move(event));
    changed_.notify_all();
  }
  return !ended_;
}

void ResumingMapStream::Impl::End(absl::Status status) {
  std::lock_guard lock(mutex_);
  if (ended_) return;
  if (status.ok() && inputs_.Unacknowledged() > 0) {
    status = FailedPrecondition("the session was finished before {} inputs were accepted", inputs_.Unacknowledged());
  }
  if (status.ok()) inputs_.Clear();
  ended_ = true;
  end_status_ = std::move(status);
  link_ = {};
  changed_.notify_all();
}

// --------------------------------------------------------------------------------------------------------- sender

void ResumingMapStream::Impl::RunSender() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return ended_ || HasWork(); });
    if (ended_) return;
    DropExpired();
    std::shared_ptr<MapStream> stream = link_.inputs;
    const auto outgoing = inputs_.TakeNext();
    if (!outgoing && !closing_) continue;
    if (!outgoing) half_closed_ = true;
    changed_.notify_all();  // Send() may wait
    lock.unlock();
    const absl::Status sent = outgoing ? SendOne(*stream, *outgoing) : stream->CloseSend();
    if (!sent.ok()) OnSendFailed(*stream, sent);
    stream.reset();  // may wait for gRPC
    lock.lock();
  }
}

bool ResumingMapStream::Impl::HasWork() const {
  return link_.inputs && !send_failed_ && !half_closed_ && (inputs_.HasWaiting() || closing_);
}

absl::Status ResumingMapStream::Impl::SendOne(MapStream& stream, const UnsettledInputs::Outgoing& outgoing) {
  if (const auto* sent_masks = std::get_if<MasksInput>(outgoing.input.get())) {
    MasksInput masks = *sent_masks;
    masks.resent = outgoing.resent;
    return stream.SendMasks(std::move(masks));
  }
  FrameInput frame = std::get<FrameInput>(*outgoing.input);
  frame.resent = outgoing.resent;
  return stream.Send(std::move(frame));
}

void ResumingMapStream::Impl::OnSendFailed(MapStream& stream, const absl::Status& failure) {
  const bool ended = !stream.status().ok();  // then the receiver sees it, too
  {
    std::lock_guard lock(mutex_);
    if (link_.inputs.get() != &stream) return;
    send_failed_ = true;
    if (!ended && !IsBrokenLink(failure)) send_status_ = failure;
    changed_.notify_all();
  }
  if (!ended && IsBrokenLink(failure)) stream.Cancel();
}

// ---------------------------------------------------------------------------------------------------------- caller

absl::Status ResumingMapStream::Impl::Send(SessionInput input) {
  const size_t bytes = UnsettledInputs::BytesOf(input);
  std::unique_lock lock(mutex_);
  if (!options_.drop_oldest) {
    changed_.wait(lock, [&] { return ended_ || closing_ || !send_status_.ok() || !IsFull(bytes); });
  }
  ROMAP_RETURN_IF_ERROR(CheckSending());
  inputs_.Add(std::move(input), Clock::now());
  if (options_.drop_oldest) DropToFit();
  changed_.notify_all();
  return absl::OkStatus();
}

absl::Status ResumingMapStream::Impl::CheckSending() const {
  if (closing_) return FailedPrecondition("CloseSend() was already called on this stream");
  ROMAP_RETURN_IF_ERROR(end_status_);
  ROMAP_RETURN_IF_ERROR(send_status_);
  if (ended_) return FailedPrecondition("the server closed the stream and accepts no more frames");
  return absl::OkStatus();
}

// An input that alone exceeds the limit is sent when no other is kept.
bool ResumingMapStream::Impl::IsFull(size_t bytes) const {
  if (inputs_.size() == 0) return false;
  return inputs_.bytes() + bytes > options_.max_bytes || inputs_.Waiting() >= options_.max_waiting;
}

void ResumingMapStream::Impl::DropToFit() {
  while (inputs_.bytes() > options_.max_bytes || inputs_.Waiting() > options_.max_waiting) {
    const auto frame_id = inputs_.DropOldestUnsentFrame();
    if (!frame_id) return;
    NoteDropped(*frame_id, "dropped: the connection is broken or too slow, and the client's memory for frames is full");
  }
}

void ResumingMapStream::Impl::DropExpired() {
  if (options_.max_age.count() == 0) return;
  for (const uint64_t frame_id : inputs_.DropUnsentFrames(Clock::now() - options_.max_age)) {
    NoteDropped(frame_id, "dropped: it waited too long, because the connection is broken or too slow");
  }
}

// Exceeds kMaxEvents if need be: neither the sender nor Send() may wait for the caller.
void ResumingMapStream::Impl::NoteDropped(uint64_t frame_id, const char* reason) {
  ++dropped_;
  FrameAck ack;
  ack.frame_id = frame_id;
  ack.accepted = false;
  ack.error = reason;
  events_.emplace_back(std::move(ack));
  changed_.notify_all();
}

absl::Status ResumingMapStream::Impl::CloseSend() {
  std::lock_guard lock(mutex_);
  if (closing_) return FailedPrecondition("CloseSend() was already called on this stream");
  ROMAP_RETURN_IF_ERROR(end_status_);
  closing_ = true;
  changed_.notify_all();
  return absl::OkStatus();
}

std::optional<MapEvent> ResumingMapStream::Impl::Next(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return ended_ || !events_.empty(); });
  if (events_.empty()) return std::nullopt;
  std::optional<MapEvent> event(std::move(events_.front()));
  events_.pop_front();
  changed_.notify_all();
  return event;
}

bool ResumingMapStream::Impl::Done() const {
  std::lock_guard lock(mutex_);
  return ended_ && events_.empty();
}

absl::Status ResumingMapStream::Impl::status() const {
  std::lock_guard lock(mutex_);
  return end_status_;
}

void ResumingMapStream::Impl::Cancel() {
  Link link;
  {
    std::lock_guard lock(mutex_);
    events_.clear();
    if (!ended_) end_status_ = absl::CancelledError("the stream was canceled");
    ended_ = true;
    link = std::exchange(link_, {});
    changed_.notify_all();
  }
  if (link.events) link.events->Cancel();
}

uint64_t ResumingMapStream::Impl::dropped() const {
  std::lock_guard lock(mutex_);
  return dropped_;
}

size_t ResumingMapStream::Impl::unsettled() const {
  std::lock_guard lock(mutex_);
  return inputs_.size();
}

bool ResumingMapStream::Impl::all_answered() const {
  std::lock_guard lock(mutex_);
  return inputs_.AllAnswered();
}

// ---------------------------------------------------------------------------------------------------------- public

absl::StatusOr<std::unique_ptr<ResumingMapStream>> ResumingMapStream::Open(MappingService* service,
                                                                           const std::string& session_id,
                                                                           const ResumeOptions& options) {
  auto impl = std::make_unique<Impl>(service, session_id, options);
  ROMAP_RETURN_IF_ERROR(impl->Start());
  return std::unique_ptr<ResumingMapStream>(new ResumingMapStream(std::move(impl)));
}

ResumingMapStream::ResumingMapStream(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ResumingMapStream::~ResumingMapStream() = default;

const StreamOpening& ResumingMapStream::opening() const { return impl_->opening(); }
std::optional<MapEvent> ResumingMapStream::Next(std::chrono::milliseconds timeout) { return impl_->Next(timeout); }
bool ResumingMapStream::Done() const { return impl_->Done(); }
absl::Status ResumingMapStream::status() const { return impl_->status(); }
void ResumingMapStream::Cancel() { impl_->Cancel(); }
absl::Status ResumingMapStream::Send(FrameInput frame) { return impl_->Send(std::move(frame)); }
absl::Status ResumingMapStream::SendMasks(MasksInput masks) { return impl_->Send(std::move(masks)); }
absl::Status ResumingMapStream::CloseSend() { return impl_->CloseSend(); }
uint64_t ResumingMapStream::dropped() const { return impl_->dropped(); }
size_t ResumingMapStream::unsettled() const { return impl_->unsettled(); }
bool ResumingMapStream::all_answered() const { return impl_->all_answered(); }

}  // namespace romap::client
