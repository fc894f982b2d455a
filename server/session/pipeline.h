#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <variant>

#include "common/field_snapshot.h"
#include "common/mapping_service.h"
#include "common/stage_messages.h"
#include "server/nerf/training_pool.h"
#include "server/objects/object_mapper.h"
#include "server/session/arrival.h"
#include "server/session/diagnostic_log.h"
#include "server/session/failure_guard.h"
#include "server/session/frame_ledger.h"
#include "server/session/ingest.h"
#include "server/session/live_view.h"
#include "server/session/map_state.h"
#include "server/session/mesh_pose.h"
#include "server/session/mesher.h"
#include "server/session/rejections.h"
#include "server/session/server_config.h"
#include "server/slam/sparse_mapper.h"
#include "server/slam/tracker.h"

namespace romap::session {

// The second half of the processing of an input, as a task for the mapping thread.
struct MappingStep {
  std::function<void()> run;
  bool is_keyframe = false;
  bool may_be_skipped = false;     // under load; then only the object masks of this frame are lost
  bool changes_local_map = false;  // later frames are tracked against the result
  bool relocalizes = false;        // the frame was lost; the newest such frame is the most useful one
};

// The client sent an input again that the session has.
struct DuplicateInput {};

// An input that was decoded, checked and, if it is valid, recorded.
struct CheckedInput {
  Arrival arrival;
  // The status: why it is rejected.
  std::variant<absl::Status, std::shared_ptr<const Frame>, FrameMasks, DuplicateInput> content;
};

// The stages of one session and the data path through them:
//
//   Ingest -> Tracker -> SparseMapper -> ObjectMapper -> TrainingPool -> Mesher -> MapState -> clients
//
// Check(), Process() and the MappingSteps read in that order. The pipeline has no thread: the caller runs each of the
// three on one thread, in the order of the inputs; the threads may be the same. The sparse map is returned to the
// tracker by value (LocalMapSlot). The training pool and the mesher belong to the server; they call MeshField() and
// PublishMesh().
class Pipeline {
 public:
  // Runs the step, or queues it for the mapping thread.
  using MappingExecutor = std::function<void(MappingStep)>;

  using InputSink = std::function<void(const SessionInput&)>;

  // `pool`, `mesher`, `map`, `ledger` and `diagnostics` outlive the pipeline. `on_accepted` gets every accepted input
  // in Check(); may be null.
  Pipeline(const SessionOptions& options, const ServerConfig& config, nerf::TrainingPool* pool, Mesher* mesher,
           MapState* map, FrameLedger* ledger, DiagnosticLog* diagnostics, InputSink on_accepted);
  ~Pipeline();  // the pool and the mesher make no more calls
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  // Decodes and checks a frame or late masks, and passes them to `on_accepted`.
  CheckedInput Check(Arrival arrival);
  // Check() returns soon, and rejects this and all later inputs. Thread-safe.
  void StopChecks() { stop_.request_stop(); }
  // Processes a checked input, or rejects it. `execute` is called at most once, before Process() returns: not at all
  // for an input that is rejected. Acknowledgments and rejections keep the order of the inputs.
  void Process(const CheckedInput& input, const MappingExecutor& execute);

  // Call on the mapping thread after the last step. Publishes the last corrections and cuboids, and lets the fields
  // train to completion.
  void FinishMapping();
  bool IsTrainingDone() const;  // and all meshes are published; meaningful after FinishMapping()
  // For a training pool without threads: trains for at most `count` slices.
  void TrainSlices(int count);

  // Call on the mapping thread now and then: shows changed points to viewers.
  void PublishPoints();
  const LiveView& live_view() const { return live_view_; }

  // Live: whether keyframes wait to be mapped. Thread-safe.
  void SetKeyframesWait(bool wait) { sparse_mapper_.SetKeyframesWait(wait); }

  nerf::TrainingPool::Progress TrainingProgress() const { return pool_->GetProgress(pool_session_); }

 private:
  void ProcessFrame(const Arrival& arrival, const std::shared_ptr<const Frame>& frame, const MappingExecutor& execute);
  std::optional<slam::TrackedImage> Track(const Arrival& arrival, const std::shared_ptr<const Frame>& frame);
  void ProcessLateMasks(const FrameMasks& masks, const MappingExecutor& execute);
  void Reject(const Arrival& arrival, const absl::Status& reason);
  void Correct(const MapCorrection& correction);
  void Publish(objects::ObjectOutput output);
  void PublishEvent(MapEvent event);
  void MeshField(FieldSnapshot snapshot);
  void PublishMesh(MeshUpdate mesh, const MeshPose& pose);

  nerf::TrainingPool* const pool_;
  Mesher* const mesher_;
  MapState* const map_;
  FrameLedger* const ledger_;
  DiagnosticLog* const diagnostics_;

  slam::LocalMapSlot local_map_;  // from the mapper to the tracker
  // Used by Check().
  std::stop_source stop_;
  Ingest ingest_;
  const InputSink on_accepted_;
  // Used by Process().
  slam::Tracker tracker_;
  FailureGuard tracker_guard_{/*max_failures_in_a_row=*/10};
  Rejections rejections_;
  LiveView live_view_;
  // Used by the mapping steps.
  bool points_changed_ = false;  // since PublishPoints()
  slam::SparseMapper sparse_mapper_;
  objects::ObjectMapper object_mapper_;

  Mesher::SessionId mesher_session_ = 0;
  nerf::TrainingPool::SessionId pool_session_ = 0;
};

}  // namespace romap::session
