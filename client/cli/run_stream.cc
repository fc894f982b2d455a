#include "client/cli/run_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>
#include <thread>

#include "client/cli/diagnostic_lines.h"
#include "client/cli/interrupt.h"
#include "client/cli/map_files.h"
#include "client/cli/mask_schedule.h"
#include "client/cli/progress.h"
#include "client/cli/unreadable_files.h"
#include "client/sdk/resuming_map_stream.h"
#include "client/sdk/retry.h"
#include "common/printable.h"
#include "common/status.h"

namespace romap::cli {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kEventWait{50};
constexpr std::chrono::seconds kMaxAckWait{5};
constexpr std::chrono::seconds kMaxDurableWait{10};
constexpr double kTrainingAfterInterrupt_s = 3;
constexpr size_t kMaxWaitingInputs = 8;  // not yet sent

double SecondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

bool IsHeldOut(const StreamOptions& options, size_t frame) {
  if (options.hold_out == 0) return false;
  return (frame - options.first_frame) / options.stride % options.hold_out == options.hold_out / 2;
}

// Loads and sends frames on a separate thread, because Send() blocks while the server applies back pressure.
class Sender {
 public:
  Sender(const files::Sequence& sequence, const StreamOptions& options, MapStream& stream, MapCollector& collector,
         std::mutex& collector_mutex, std::function<void(const Diagnostic&)> on_first_unreadable)
      : sequence_(sequence),
        options_(options),
        stream_(stream),
        collector_(collector),
        collector_mutex_(collector_mutex),
        end_(std::min(sequence.size(), options.first_frame + std::min(options.frame_count, sequence.size()))),
        unreadable_(sequence, options.first_frame, end_),
        on_first_unreadable_(std::move(on_first_unreadable)),
        thread_([this] {
          status_ = Run();
          done_ = true;
        }) {}

  ~Sender() { Join(); }

  void Join() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  bool done() const { return done_; }
  // Valid once done().
  const absl::Status& status() const { return status_; }
  // Valid after Join().
  const UnreadableFiles& unreadable() const { return unreadable_; }
  // Ids of frames.
  std::vector<uint64_t> Skipped() const {
    std::vector<uint64_t> skipped = unreadable_.skipped_frames();
    skipped.insert(skipped.end(), held_out_.begin(), held_out_.end());
    std::sort(skipped.begin(), skipped.end());
    return skipped;
  }

 private:
  absl::Status Run() {
    for (size_t i = options_.first_frame; i < end_ && !stop_ && !Interrupted(); i += options_.stride) {
      if (IsHeldOut(options_, i)) {
        held_out_.push_back(i + 1);
        continue;
      }
      ROMAP_ASSIGN_OR_RETURN(std::optional<FrameInput> frame, Load(i));
      if (!frame) continue;
      ROMAP_RETURN_IF_ERROR(SendMasksDueBy(frame->timestamp_ns));
      WaitFor(frame->timestamp_ns);
      schedule_.Apply(*frame);
      {
        std::lock_guard lock(collector_mutex_);
        collector_.NoteSent(frame->frame_id, frame->timestamp_ns, frame->mask_encoding != MaskEncoding::kNone,
                            frame->T_world_camera.has_value(), sequence_.paths(i));
      }
      ROMAP_RETURN_IF_ERROR(stream_.Send(*std::move(frame)));
    }
    return SendMasksDueBy(std::numeric_limits<int64_t>::max());
  }

  // nullopt: the image cannot be read. An error: too many files cannot be read.
  absl::StatusOr<std::optional<FrameInput>> Load(size_t index) {
    std::vector<files::UnreadableFile> unreadable;
    absl::StatusOr<FrameInput> frame = sequence_.LoadReadable(index, &unreadable);
    if (!frame.ok()) unreadable.push_back({files::FileKind::kImage, frame.status()});
    for (const files::UnreadableFile& file : unreadable) {
      ROMAP_RETURN_IF_ERROR(unreadable_.Note(index + 1, file));
      if (const auto first = unreadable_.FirstOf(file.kind, index + 1)) on_first_unreadable_(*first);
    }
    return frame.ok() ? std::optional(*std::move(frame)) : std::nullopt;
  }

  absl::Status SendMasksDueBy(int64_t timestamp_ns) {
    while (auto late = stop_ || Interrupted() ? std::nullopt : schedule_.TakeDueBy(timestamp_ns)) {
      WaitFor(late->due_ns);
      {
        std::lock_guard lock(collector_mutex_);
        collector_.NoteLateMasksSent();
      }
      ROMAP_RETURN_IF_ERROR(stream_.SendMasks(std::move(late->masks)));
    }
    return absl::OkStatus();
  }

  // In real-time mode, waits until the recorded time relative to the first frame.
  void WaitFor(int64_t timestamp_ns) const {
    if (!options_.realtime) return;
    std::this_thread::sleep_until(
        start_ + std::chrono::nanoseconds(timestamp_ns - sequence_.timestamp_ns(options_.first_frame)));
  }

  const files::Sequence& sequence_;
  const StreamOptions& options_;
  MapStream& stream_;
  MapCollector& collector_;
  std::mutex& collector_mutex_;
  const size_t end_;  // of the frames to send
  UnreadableFiles unreadable_;
  const std::function<void(const Diagnostic&)> on_first_unreadable_;  // of each kind of file
  std::vector<uint64_t> held_out_;                                    // ids of frames
  MaskSchedule schedule_{options_.mask_rate_hz, options_.mask_delay_s};
  const Clock::time_point start_ = Clock::now();
  std::atomic<bool> stop_ = false;
  std::atomic<bool> done_ = false;
  absl::Status status_;
  std::thread thread_;
};

// Says once when the link breaks or the server is not ready, and when the stream is open again.
class LinkMessages {
 public:
  explicit LinkMessages(Progress& progress) : progress_(progress) {}

  // On a thread of the stream.
  void Note(bool up, const std::string& reason, int attempt) {
    if (up) {
      progress_.Say("link restored");
    } else if (attempt == 0) {
      progress_.Say(fmt::format("link lost, retrying ({})", reason));
    } else if (!std::exchange(waits_, true)) {
      progress_.Say(fmt::format("waiting for the server ({})", reason));
    }
    if (up) waits_ = false;
  }

 private:
  Progress& progress_;
  bool waits_ = false;
};

class Run {
 public:
  Run(const files::Sequence& sequence, MappingService& service, const StreamOptions& options, MapCollector& collector)
      : sequence_(sequence), service_(service), options_(options), collector_(collector), link_(progress_) {}

  absl::StatusOr<StreamResult> Execute() {
    SessionOptions session;
    session.name = options_.session_name;
    session.camera = sequence_.camera();
    session.pose_use = options_.pose_use;
    session.up_world = options_.up_world;
    session.estimate_up = options_.estimate_up;
    session.mode = options_.realtime ? FrameMode::kLive : FrameMode::kReplay;
    result_.session_id = options_.session_id;
    if (result_.session_id.empty()) {
      ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service_.CreateSession(session));
      result_.session_id = info.id;
    }
    ROMAP_RETURN_IF_ERROR(OpenStream());
    for (const Diagnostic& diagnostic : sequence_.diagnostics()) lines_.Say(diagnostic);
    result_.status = SendFrames();
    if (result_.status.ok() && !options_.leave_open) result_.status = Train();
    progress_.Done();
    stream_.reset();
    if (result_.status.ok()) FetchTrajectory();
    result_.said = lines_.Said();
    return result_;
  }

 private:
  absl::Status OpenStream() {
    if (options_.resume) {
      client::ResumeOptions resume;
      resume.retry = Retry();
      // A recorded sequence can wait. Frames of a live one are kept while the connection is broken, as far as they fit
      // into the memory.
      resume.drop_oldest = options_.realtime;
      if (!options_.realtime) resume.max_waiting = kMaxWaitingInputs;
      resume.on_link = [this](bool up, const std::string& reason, int attempt) { link_.Note(up, reason, attempt); };
      ROMAP_ASSIGN_OR_RETURN(auto resuming,
                             client::ResumingMapStream::Open(&service_, result_.session_id, std::move(resume)));
      resuming_ = resuming.get();
      stream_ = std::move(resuming);
    } else {
      ROMAP_ASSIGN_OR_RETURN(stream_, service_.OpenMap(result_.session_id));
    }
    result_.durable = stream_->opening().durable;
    result_.first_frame = options_.session_id.empty() ? options_.first_frame : 0;
    const std::optional<uint64_t> newest = stream_->opening().newest_frame_id;
    if (options_.session_id.empty() || !newest) return absl::OkStatus();
    // Frame ids are indices + 1.
    options_.first_frame = std::max<size_t>(options_.first_frame, *newest);
    result_.frames_before = options_.first_frame;
    if (options_.first_frame < sequence_.size()) return absl::OkStatus();
    return InvalidArgument("--session {}: it has all {} frames of the sequence already", options_.session_id,
                           sequence_.size());
  }

  static client::RetryOptions Retry() {
    client::RetryOptions retry;
    retry.keep_trying = [] { return !Interrupted(); };
    return retry;
  }

  absl::Status SendFrames() {
    Sender sender(sequence_, options_, *stream_, collector_, collector_mutex_,
                  [this](const Diagnostic& diagnostic) { lines_.Say(diagnostic); });
    const absl::Status status = AwaitAcknowledgements(sender);
    sender.Join();
    result_.diagnostics = sender.unreadable().Diagnostics();
    result_.skipped_frames = sender.Skipped();
    return status;
  }

  absl::Status AwaitAcknowledgements(Sender& sender) {
    std::optional<Clock::time_point> deadline;
    while (!(sender.done() && AllAcknowledged())) {
      ReceiveEvent();
      ShowFrames();
      // After an interrupt or a sending error, limits the wait for a server that does not respond.
      if (!deadline && (Interrupted() || (sender.done() && !sender.status().ok()))) {
        deadline = Clock::now() + kMaxAckWait;
      }
      if (deadline && Clock::now() > *deadline) break;
      if (stream_->Done()) {
        sender.Join();
        return StreamEnded();
      }
    }
    result_.mapping_s = collector_.last_ack_s() - collector_.first_sent_s();
    if (sender.done() && sender.status().ok()) AwaitDurable();
    result_.interrupted = Interrupted();
    if (!sender.done()) {
      stream_->Cancel();  // unblocks Send()
      return absl::DeadlineExceededError("the server stopped accepting frames");
    }
    return sender.status();
  }

  // A server that is restarted loses what it had accepted but not yet stored. Such inputs can be sent again only while
  // the session is not finished. A server whose disk is full stores nothing; hence the limit.
  void AwaitDurable() {
    Clock::time_point answered = Clock::now();
    while (resuming_ != nullptr && resuming_->unsettled() > 0 && !stream_->Done() && !Interrupted()) {
      ReceiveEvent();
      if (!resuming_->all_answered()) answered = Clock::now();
      if (Clock::now() > answered + kMaxDurableWait) return;
    }
  }

  absl::Status Train() {
    ROMAP_RETURN_IF_ERROR(
        client::RetryWhileUnavailable([&] { return service_.FinishSession(result_.session_id); }, Retry()).status());
    const Clock::time_point start = Clock::now();
    const auto timed_out = [&] {
      return SecondsSince(start) > (Interrupted() ? kTrainingAfterInterrupt_s : options_.max_training_s);
    };
    while (!stream_->Done() && !timed_out()) {
      ReceiveEvent();
      ShowTraining();
    }
    result_.training_s = SecondsSince(start);
    result_.interrupted = Interrupted();
    result_.training_complete = stream_->Done();
    return stream_->Done() ? stream_->status() : absl::OkStatus();
  }

  void FetchTrajectory() {
    const auto map = client::RetryWhileUnavailable([&] { return service_.ExportMap(result_.session_id); }, Retry());
    if (map.ok()) {
      result_.trajectory = TrajectoryOf(*map);
    } else {
      fmt::print(stderr, "romap: the trajectory lacks later corrections because the map could not be exported: {}\n",
                 PrintableLines(Message(map.status())));
    }
  }

  void ReceiveEvent() {
    std::optional<MapEvent> event = stream_->Next(kEventWait);
    if (!event) return;
    SayNews(*event);
    std::lock_guard lock(collector_mutex_);
    collector_.Apply(*event);
  }

  // The statistics have those that were sent as events before a continued stream was opened.
  void SayNews(const MapEvent& event) {
    if (const auto* diagnostic = std::get_if<Diagnostic>(&event)) {
      lines_.SayNews(*diagnostic);
    } else if (const auto* statistics = std::get_if<Statistics>(&event)) {
      lines_.SayPresent(statistics->diagnostics);
    }
  }

  bool AllAcknowledged() {
    std::lock_guard lock(collector_mutex_);
    const MapCollector::LateMasks& masks = collector_.late_masks();
    return collector_.acknowledged() >= collector_.sent() && masks.acknowledged >= masks.sent;
  }

  absl::Status StreamEnded() {
    if (!stream_->status().ok()) return stream_->status();
    return absl::UnavailableError("the server closed the stream before acknowledging all frames");
  }

  size_t TotalFrames() const {
    const size_t frames = sequence_.size() - std::min(sequence_.size(), options_.first_frame);
    return (std::min(options_.frame_count, frames) + options_.stride - 1) / options_.stride -
           HeldOutFrames(sequence_, options_).size();
  }

  void ShowFrames() {
    std::lock_guard lock(collector_mutex_);
    const double fraction = static_cast<double>(collector_.acknowledged()) / std::max<size_t>(1, TotalFrames());
    progress_.Show(Progress::kFrameFraction * fraction,
                   fmt::format("frame {}/{}, {} objects", collector_.acknowledged(), TotalFrames(),
                               collector_.ConfirmedObjects()));
  }

  void ShowTraining() {
    std::lock_guard lock(collector_mutex_);
    const Statistics statistics = collector_.statistics().value_or(Statistics{});
    progress_.Show(
        Progress::kFrameFraction + (1 - Progress::kFrameFraction) * statistics.training_progress,
        fmt::format("{} objects, {} in training", collector_.ConfirmedObjects(), statistics.objects_training));
  }

  const files::Sequence& sequence_;
  MappingService& service_;
  StreamOptions options_;
  MapCollector& collector_;
  std::mutex collector_mutex_;  // shared with the sender thread
  StreamResult result_;
  Progress progress_{"mapping"};
  DiagnosticLines lines_{[this](const std::string& line) {
    if (options_.say_diagnostics) progress_.Say(line);
  }};
  LinkMessages link_;
  std::unique_ptr<MapStream> stream_;                    // its threads use the members above
  const client::ResumingMapStream* resuming_ = nullptr;  // stream_, if it resumes
};

}  // namespace

std::vector<size_t> HeldOutFrames(const files::Sequence& sequence, const StreamOptions& options) {
  const size_t end = std::min(sequence.size(), options.first_frame + std::min(options.frame_count, sequence.size()));
  std::vector<size_t> frames;
  for (size_t i = options.first_frame; i < end; i += options.stride) {
    if (IsHeldOut(options, i)) frames.push_back(i);
  }
  return frames;
}

absl::StatusOr<StreamResult> StreamSequence(const files::Sequence& sequence, MappingService& service,
                                            const StreamOptions& options, MapCollector& collector) {
  if (options.first_frame >= sequence.size()) {
    return InvalidArgument("--first {}: the sequence has only {} frames", options.first_frame, sequence.size());
  }
  return Run(sequence, service, options, collector).Execute();
}

std::vector<Diagnostic> DiagnosticsOf(const StreamResult& result, const MapCollector& collector) {
  std::vector<Diagnostic> diagnostics = result.diagnostics;
  if (collector.statistics()) {
    const std::vector<Diagnostic>& server = collector.statistics()->diagnostics;
    diagnostics.insert(diagnostics.end(), server.begin(), server.end());
  }
  return diagnostics;
}

}  // namespace romap::cli
