#include "client/bench/load_bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <variant>

namespace romap::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kPoll{50};
constexpr std::chrono::seconds kDrain{20};  // for the last acknowledgments

// Index of the n-th sent frame: 0 1 2 3 2 1 0 1 ... for four frames.
size_t FrameAt(uint64_t n, size_t count) {
  if (count == 1) return 0;
  const uint64_t period = 2 * (count - 1);
  const uint64_t phase = n % period;
  return static_cast<size_t>(phase < count ? phase : period - phase);
}

// One client: a thread that sends, and a thread that reads events.
class Client {
 public:
  Client(const std::vector<FrameInput>* frames, MappingService* service, const LoadOptions& options)
      : frames_(*frames), service_(*service), options_(options) {}

  // Opens the session. False: it was refused.
  bool Open(const CameraModel& camera, int number) {
    auto session = service_.CreateSession({.name = fmt::format("load {}", number),
                                           .camera = camera,
                                           .mode = FrameMode::kLive,
                                           .pose_use = options_.pose_use});
    if (session.ok()) {
      session_id_ = session->id;
      auto stream = service_.OpenMap(session_id_);
      if (stream.ok()) {
        stream_ = *std::move(stream);
        return true;
      }
      session = stream.status();
    }
    load_.refused = Message(session.status());
    return false;
  }
  const std::string& session_id() const { return session_id_; }

  void Start(Clock::time_point start, Clock::time_point end) {
    sender_is_running_ = true;
    sender_ = std::thread([this, start, end] { Send(start, end); });
    reader_ = std::thread([this] { Read(); });
  }

  // Ends the sending early.
  void Stop() { ended_ = true; }

  ClientLoad Finish() {
    if (sender_.joinable()) sender_.join();
    if (reader_.joinable()) reader_.join();
    if (stream_) stream_->Cancel();
    if (!session_id_.empty()) {
      if (const auto info = service_.GetSession(session_id_); info.ok()) {
        load_.dropped = info->statistics.frames_dropped;
        load_.training_steps = info->statistics.training_steps;
        load_.objects = info->statistics.objects;
      }
      stream_.reset();
      service_.DeleteSession(session_id_).IgnoreError();
    }
    return std::move(load_);
  }

  double ResidentBytes() const { return resident_bytes_; }

 private:
  void Send(Clock::time_point start, Clock::time_point end) {
    const auto period =
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / options_.rate_hz));
    const auto period_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(period).count();
    for (uint64_t n = 0;; ++n) {
      const Clock::time_point due = start + static_cast<int64_t>(n) * period;
      if (due >= end || ended_) break;
      std::this_thread::sleep_until(due);
      FrameInput frame = frames_[FrameAt(n, frames_.size())];
      frame.frame_id = n + 1;
      frame.timestamp_ns = static_cast<int64_t>(n + 1) * period_ns;
      const Clock::time_point sent = Clock::now();
      if (sent > due + period) ++late_;
      {
        std::lock_guard lock(mutex_);
        sent_.push_back({frame.frame_id, sent});
        unstored_.push_back({frame.frame_id, sent});
      }
      if (!stream_->Send(std::move(frame)).ok()) break;  // the reader reports why
      ++sent_count_;
    }
    stream_->CloseSend().IgnoreError();
    sender_is_running_ = false;
  }

  void Read() {
    std::optional<Clock::time_point> closing_since;
    while (!stream_->Done()) {
      const std::optional<MapEvent> event = stream_->Next(kPoll);
      if (event) std::visit([&](const auto& content) { Note(content); }, *event);
      if (stream_->Done()) break;
      if (!sender_is_running_ && !closing_since) closing_since = Clock::now();
      if (closing_since && Clock::now() - *closing_since > kDrain) break;
    }
    ended_ = true;
    load_.error = stream_->status().ok() ? "" : Message(stream_->status());
    load_.sent = sent_count_;
    load_.late = late_;
  }

  void Note(const FrameAck& ack) {
    const Clock::time_point now = Clock::now();
    std::lock_guard lock(mutex_);
    // Acknowledgments come in the order of the frames.
    while (!sent_.empty() && sent_.front().first <= ack.frame_id) {
      if (sent_.front().first == ack.frame_id) {
        ++load_.acknowledged;
        if (ack.accepted) load_.ack_s.push_back(std::chrono::duration<double>(now - sent_.front().second).count());
      }
      sent_.pop_front();
    }
    if (!ack.accepted) ++load_.rejected;
    if (ack.T_world_camera) ++load_.tracked;
  }
  void Note(const Durable& durable) {
    const Clock::time_point now = Clock::now();
    std::lock_guard lock(mutex_);
    while (!unstored_.empty() && unstored_.front().first <= durable.frame_id) {
      load_.durable_s.push_back(std::chrono::duration<double>(now - unstored_.front().second).count());
      unstored_.pop_front();
    }
  }
  void Note(const Statistics& statistics) { resident_bytes_ = static_cast<double>(statistics.resident_bytes); }
  template <class Event>
  void Note(const Event& /*event*/) {}

  const std::vector<FrameInput>& frames_;
  MappingService& service_;
  const LoadOptions options_;
  std::string session_id_;
  std::unique_ptr<MapStream> stream_;
  ClientLoad load_;  // the reader's

  std::mutex mutex_;
  std::deque<std::pair<uint64_t, Clock::time_point>> sent_;      // not acknowledged yet; guarded by mutex_
  std::deque<std::pair<uint64_t, Clock::time_point>> unstored_;  // the same
  std::atomic<bool> sender_is_running_ = false;
  std::atomic<bool> ended_ = false;
  std::atomic<uint64_t> sent_count_ = 0;
  std::atomic<uint64_t> late_ = 0;
  std::atomic<double> resident_bytes_ = 0;
  std::thread sender_, reader_;
};

// A viewer that reads until the end.
class Viewer {
 public:
  Viewer(MappingService& service, const std::string& session_id) {
    auto events = service.Watch(session_id);
    if (!events.ok()) {
      load_.error = Message(events.status());
      return;
    }
    events_ = *std::move(events);
    thread_ = std::thread([this] {
      while (!events_->Done()) {
        if (events_->Next(kPoll)) ++load_.events;
      }
    });
  }
  ViewerLoad Finish() {
    if (events_) events_->Cancel();
    if (thread_.joinable()) thread_.join();
    return load_;
  }

 private:
  ViewerLoad load_;
  std::unique_ptr<EventStream> events_;
  std::thread thread_;
};

}  // namespace

absl::StatusOr<LoadResults> RunLoadBench(const files::Sequence& sequence, MappingService& service,
                                         const LoadOptions& options,
                                         const std::function<void(double fraction, const std::string& text)>& progress,
                                         const std::function<bool()>& stop) {
  std::vector<FrameInput> frames;
  for (size_t i = 0; i < sequence.size(); ++i) {
    ROMAP_ASSIGN_OR_RETURN(FrameInput frame, sequence.Load(i));
    if (options.pose_use == PoseUse::kIgnore) frame.T_world_camera.reset();
    frames.push_back(std::move(frame));
  }
  std::vector<std::unique_ptr<Client>> clients;
  std::vector<std::string> sessions;
  LoadResults results{.duration_s = 0, .rate_hz = options.rate_hz, .stalled_viewers = options.stalled_viewers};
  const Clock::time_point start = Clock::now();
  const Clock::time_point end =
      start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.duration_s));
  // One after another, as clients come: the server may refuse the later ones because of what the first ones need.
  for (int i = 0; i < options.clients; ++i) {
    clients.push_back(std::make_unique<Client>(&frames, &service, options));
    if (!clients.back()->Open(sequence.camera(), i + 1)) continue;
    sessions.push_back(clients.back()->session_id());
    clients.back()->Start(Clock::now(), end);
  }
  std::vector<std::unique_ptr<Viewer>> viewers;
  std::vector<std::unique_ptr<EventStream>> stalled;
  for (int i = 0; i < options.viewers && !sessions.empty(); ++i) {
    viewers.push_back(std::make_unique<Viewer>(service, sessions[static_cast<size_t>(i) % sessions.size()]));
  }
  for (int i = 0; i < options.stalled_viewers && !sessions.empty(); ++i) {
    auto events = service.Watch(sessions[static_cast<size_t>(i) % sessions.size()]);
    if (events.ok()) stalled.push_back(*std::move(events));
  }
  while (Clock::now() < end && !sessions.empty() && !stop()) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    const double elapsed_s = std::chrono::duration<double>(Clock::now() - start).count();
    double bytes = 0;
    for (const auto& client : clients) bytes = std::max(bytes, client->ResidentBytes());
    if (bytes > 0) results.memory.push_back({elapsed_s, bytes});
    progress(std::min(1.0, elapsed_s / options.duration_s),
             fmt::format("{} clients, {} refused", sessions.size(), clients.size() - sessions.size()));
  }
  if (stop()) {
    for (const auto& client : clients) client->Stop();
  }
  results.duration_s = std::chrono::duration<double>(Clock::now() - start).count();
  for (const auto& client : clients) results.clients.push_back(client->Finish());
  for (const auto& events : stalled) events->Cancel();
  for (const auto& viewer : viewers) results.viewers.push_back(viewer->Finish());
  return results;
}

}  // namespace romap::bench
