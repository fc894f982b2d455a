#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <variant>

#include "common/bounded_queue.h"
#include "common/mapping_service.h"
#include "common/wire/recording.h"
#include "server/nerf/training_pool.h"
#include "server/objects/object_mapper.h"
#include "server/session/ingest.h"
#include "server/session/map_state.h"
#include "server/session/mesher.h"
#include "server/session/server_config.h"
#include "server/slam/sparse_mapper.h"
#include "server/slam/tracker.h"

namespace romap::session {

// One client's map. Owns the stages and wires the data path; two threads of its own:
//
//   inputs -> [tracking thread: Ingest, Tracker] -> tracked -> [mapping thread: SparseMapper, ObjectMapper]
//          -> TrainingPool (server's) -> Mesher (server's) -> MapState -> outboxes
//
// Masks that come after their frame take the same way, past the trackers, so that every stage has seen the frame.
// The sparse map goes back to tracking as a value (LocalMapSlot); its corrections go down the same path as the frames.
// With session.single_thread the tracking thread does all of it, frame by frame and in a fixed order, so that the same
// frames give the same map to the last bit; the pool and the mesher then have no threads either.
//
// What was accepted is never lost while the session lives; closing a stream closes nothing here.
class Session {
 public:
  // `pool` and `mesher` outlive the session. `recorder` is told all that is accepted; none = not recorded.
  Session(std::string id, const SessionOptions& options, const ServerConfig& config, nerf::TrainingPool* pool,
          Mesher* mesher, std::unique_ptr<wire::RecordingWriter> recorder = nullptr);
  ~Session();

  SessionInfo Info() const;
  MapSnapshot Export() const;

  // Takes a frame, or the masks of one that was offered before. kReplay: waits while the queue is full; kLive: drops
  // the oldest that waits instead. Answered with a FrameAck or a MasksAck. FAILED_PRECONDITION after Finish().
  absl::Status Offer(SessionInput input);
  // No more frames will come. Returns at once; the state tells when all is done.
  void Finish();
  // Ends the threads without training to the end, and every stream with `status`. Called before deletion.
  void Stop(const absl::Status& status);

  // Claims the right to send frames; false when another stream holds it.
  bool AttachSender();
  void DetachSender();  // gives it back
  // Calls `done` (on a session thread, or at once) when all that was offered before this call has been mapped.
  void WhenDrained(std::function<void()> done);

  MapState& map() { return map_; }
  const SessionConfig& config() const { return config_.session; }

 private:
  using Clock = std::chrono::steady_clock;

  struct Arrival {
    SessionInput input;
    Clock::time_point time;
  };
  using MappingTask = std::variant<slam::TrackedImage, FrameMasks>;

  void RunTracking();
  void RunMapping();
  void RunAll();
  void EndMapping();
  void Take(const Arrival& arrival);
  void Record(const SessionInput& input);
  void TrackFrame(const Arrival& arrival);
  void TakeMasks(const Arrival& arrival);
  void QueueLive(slam::TrackedImage image);
  void QueueReplay(slam::TrackedImage image);
  void CountMapChange(int change);
  void Acknowledge(const Arrival& arrival, const TrackedFrame& tracked);
  void Map(const MappingTask& task);
  void MapFrame(const slam::TrackedImage& image);
  void MapMasks(const FrameMasks& masks);
  void Correct(const MapCorrection& correction);
  void Publish(objects::ObjectOutput output);
  void TrainToTheEnd();
  void PublishStatistics();
  void Settle();
  void Fail(const char* stage, const std::string& what);
  void Reject(const Arrival& arrival, const std::string& why);
  void Drop(const Arrival& arrival);
  void Refuse(const Arrival& arrival, const std::string& why, TrackingState state);
  void SettleAll();
  Statistics CurrentStatistics() const;

  const std::string id_;
  const SessionOptions options_;
  const ServerConfig config_;
  const int64_t created_unix_ns_;
  nerf::TrainingPool* const pool_;
  Mesher* const mesher_;

  MapState map_;
  uint64_t mesher_client_ = 0;
  uint64_t pool_client_ = 0;

  std::unique_ptr<wire::RecordingWriter> recorder_;  // tracking thread

  Ingest ingest_;                        // tracking thread
  slam::LocalMapSlot local_map_;         // from the mapping thread to the tracking thread
  slam::Tracker tracker_;                // tracking thread
  slam::SparseMapper sparse_mapper_;     // mapping thread
  objects::ObjectMapper object_mapper_;  // mapping thread
  Clock::time_point next_statistics_;    // mapping thread

  BoundedQueue<Arrival> inputs_;
  BoundedQueue<MappingTask> tracked_;
  std::atomic<int> keyframes_waiting_ = 0;  // live: in `tracked_`

  std::atomic<SessionState> state_ = SessionState::kOpen;
  std::atomic<bool> sender_attached_ = false;
  std::atomic<bool> stopping_ = false;  // destruction: do not train to the end
  std::atomic<uint64_t> frames_received_ = 0, frames_processed_ = 0, frames_dropped_ = 0, frames_rejected_ = 0;
  std::atomic<uint64_t> keyframes_ = 0, map_points_ = 0;

  std::atomic<uint64_t> offered_ = 0;  // frames and late masks

  std::mutex drain_mutex_;
  uint64_t settled_ = 0;         // of them: mapped, refused or dropped
  int map_changes_waiting_ = 0;  // replay: frames under way that will change the local map
  std::condition_variable map_changed_;
  bool all_settled_ = false;                                      // nothing will come any more
  std::multimap<uint64_t, std::function<void()>> drain_waiters_;  // by how much must be settled

  std::thread tracking_thread_;
  std::thread mapping_thread_;
};

}  // namespace romap::session
