#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "common/bounded_queue.h"
#include "common/mapping_service.h"
#include "server/session/arrival.h"
#include "server/session/frame_ledger.h"
#include "server/session/live_load.h"
#include "server/session/pipeline.h"
#include "server/session/session_config.h"
#include "server/session/stage_watch.h"

namespace romap::session {

// Runs a session's pipeline: queues and threads only.
//
//   client threads -> inputs -> [ingest thread: Pipeline::Accept()] -> accepted -> [tracking thread: Process()] ->
//   steps
//   -> [mapping thread: MappingStep::run()]
//
// Inputs that come late because of a broken connection (resent), and those of a stored session that is restored, are
// processed as in a replay, because they come faster than the camera.
//
// Replay: a full queue blocks, and steps that change the local map are executed before the next frame is tracked. Live:
// a full input queue drops its oldest input; tracking never waits for the mapping of a frame. Single thread
// (session.single_thread): the tracking thread does all this and trains too, in a fixed order, so that equal input
// gives an identical map. In this mode the training pool and the mesher must have no threads.
class Scheduler {
 public:
  // Called on the scheduler's threads.
  struct Callbacks {
    std::function<void()> tick;      // between steps, and while there are none; at least every statistics period
    std::function<void()> finished;  // everything is mapped, trained and published
    std::function<void(const char* stage, const std::string& what)> failed;  // a stage threw; processing stops
  };

  // Starts the threads. Throws std::system_error if one of them cannot be started. `pipeline` and `ledger` outlive the
  // scheduler.
  // Log messages of the threads name the session.
  Scheduler(const std::string& session_id, const SessionConfig& config, FrameMode mode, Pipeline* pipeline,
            FrameLedger* ledger, Callbacks callbacks);
  ~Scheduler() { Stop(); }

  // Queues an input. False after CloseInputs() or a failure.
  bool Offer(SessionInput input);
  // Until EndRestoring(), a live session is processed like a replay session, so that no stored input is dropped.
  void BeginRestoring() { restoring_ = true; }
  void EndRestoring() { restoring_ = false; }
  // No more inputs. Returns immediately; `finished` is called after everything is processed.
  void CloseInputs() { inputs_.Close(); }
  // A stage that has run longer than `limit`, see StageWatch. Thread-safe.
  std::optional<StageHang> FindHang(std::chrono::duration<double> limit,
                                    std::chrono::duration<double> confirmation = std::chrono::seconds(0)) {
    return watch_.FindHang(limit, confirmation);
  }
  // Ends the processing as a failed stage does, without waiting for the threads. One of them hangs, so that Stop()
  // would not return. Thread-safe.
  void Abandon(const StageHang& hang);
  // Of the inputs of a live client.
  const LiveLoad& live_load() const { return live_load_; }
  // Ends and joins the threads without processing the waiting inputs or completing the training. Must not be called by
  // a callback.
  void Stop();

 private:
  // A step with the mode in which it was queued.
  struct QueuedStep {
    MappingStep step;
    bool is_live = false;
  };

  bool IsLive(const SessionInput& input) const;
  void RunIngest();        // the ingest thread
  void RunTracking();      // the tracking thread
  void RunMapping();       // the mapping thread
  void RunSingleThread();  // all on one thread

  // How a mapping step is executed in each mode; called by the pipeline on the tracking thread.
  void ExecuteImmediately(const MappingStep& step);
  void ExecuteReplay(MappingStep step);
  void ExecuteLive(MappingStep step);
  void RunStep(const QueuedStep& queued);
  // Runs `work`, and counts its CPU time if it is for a live input.
  template <class Work>
  void Measure(bool is_live, const Work& work);

  void TrainToCompletion();
  void Fail(const char* stage, const std::string& what);
  void EndMapping();

  const SessionConfig config_;
  const FrameMode mode_;
  Pipeline* const pipeline_;
  FrameLedger* const ledger_;
  const Callbacks callbacks_;

  LiveLoad live_load_;
  StageWatch watch_;
  BoundedQueue<Arrival> inputs_;
  BoundedQueue<CheckedInput> checked_;
  BoundedQueue<QueuedStep> steps_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> restoring_ = false;
  std::atomic<int> resent_waiting_ = 0;  // in `inputs_`
  std::atomic<bool> failed_ = false;

  std::atomic<int> keyframes_waiting_ = 0;    // live: in `steps_`
  std::atomic<int> lost_frames_waiting_ = 0;  // the same
  std::mutex mutex_;
  std::condition_variable local_map_changed_;
  int map_changes_waiting_ = 0;  // replay: steps in `steps_` that change the local map
  bool mapping_ended_ = false;

  std::thread ingest_thread_;
  std::thread tracking_thread_;
  std::thread mapping_thread_;
};

}  // namespace romap::session
