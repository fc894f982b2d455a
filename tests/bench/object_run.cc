#include "tests/bench/object_run.h"

#include <sys/resource.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <set>
#include <utility>

#include "server/objects/object_mapper.h"
#include "server/session/ingest.h"
#include "server/slam/sparse_mapper.h"
#include "server/slam/tracker.h"
#include "tests/support/sparse_mapper_inspector.h"

namespace romap::measure {
namespace {

double UserSeconds() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

std::vector<std::string> ClassNames(const files::Sequence& sequence) {
  std::set<std::string> names;
  if (sequence.objects()) {
    for (const files::ObjectRecord& record : sequence.objects()->objects) names.insert(record.class_name);
  }
  return {names.begin(), names.end()};
}

class Runner {
 public:
  Runner(const files::Sequence& sequence, const ObjectRunOptions& options)
      : ingest_(sequence.camera(), options.objects.max_mask_delay_s),
        damager_(options.damage, ClassNames(sequence)),
        tracker_(options.slam, options.poses, &local_map_),
        sparse_mapper_(options.slam, &local_map_, slam::SparseMapper::Background::kNothing),
        object_mapper_(options.objects) {}

  absl::Status Process(const FrameInput& input) {
    ROMAP_ASSIGN_OR_RETURN(const std::shared_ptr<const Frame> frame, ingest_.Accept(input));
    const slam::MappedFrame mapped = sparse_mapper_.Process(tracker_.Track(damager_.Damage(*frame)));
    if (mapped.correction) Record(object_mapper_.Correct(*mapped.correction));
    const double frame_start_s = UserSeconds();
    Record(object_mapper_.ObserveFrame(mapped.tracked));
    run_.frames_s += UserSeconds() - frame_start_s;
    if (mapped.view) Observe(*mapped.view);
    TakeLateMasks(input.timestamp_ns);
    RecordPose(mapped.tracked);
    ++run_.frames;
    return absl::OkStatus();
  }

  ObjectRun Finish() {
    TakeLateMasks(std::numeric_limits<int64_t>::max());
    Record(object_mapper_.Correct(sparse_mapper_.Finish()));
    Record(object_mapper_.Finish());
    for (const Tracked& tracked : tracked_) run_.trajectory.push_back({tracked.timestamp_ns, CurrentPose(tracked)});
    return std::move(run_);
  }

 private:
  // The pose of a frame and its reference keyframe, see TrackedFrame.
  struct Tracked {
    int64_t timestamp_ns = 0;
    SE3<World, Camera> T_world_camera;
    KeyframeId reference;
    SE3<Camera, Camera> T_reference_camera;
  };

  void Observe(const KeyframeView& view) {
    const double start_s = UserSeconds();
    Record(object_mapper_.ObserveKeyframe(view));
    const double keyframe_s = UserSeconds() - start_s;
    run_.keyframes_s += keyframe_s;
    run_.slowest_keyframe_s = std::max(run_.slowest_keyframe_s, keyframe_s);
    ++run_.keyframes;
  }

  void TakeLateMasks(int64_t now_ns) {
    while (const std::optional<FrameMasks> masks = damager_.TakeLateMasks(now_ns)) {
      sparse_mapper_.ObserveMasks(*masks);
      const double start_s = UserSeconds();
      Record(object_mapper_.ObserveLateMasks(*masks));
      run_.frames_s += UserSeconds() - start_s;
    }
  }

  void RecordPose(const TrackedFrame& tracked) {
    if (tracked.state != TrackingState::kTracking && tracked.state != TrackingState::kRelocalized) return;
    tracked_.push_back(
        {tracked.frame->timestamp_ns, tracked.T_world_camera, tracked.reference, tracked.T_reference_camera});
  }

  SE3<World, Camera> CurrentPose(const Tracked& tracked) const {
    if (!tracked.reference) return tracked.T_world_camera;
    const auto reference = slam::SparseMapperInspector(sparse_mapper_).map().KeyframePose(tracked.reference);
    return reference ? reference->Compose(tracked.T_reference_camera) : tracked.T_world_camera;
  }

  void Record(const objects::ObjectOutput& output) {
    const auto frame = static_cast<size_t>(run_.frames);
    for (const MapEvent& event : output.events) {
      if (const auto* update = std::get_if<ObjectUpdate>(&event)) {
        const auto [entry, is_new] = run_.objects.try_emplace(update->id);
        if (is_new) entry->second.first_frame = frame;
        entry->second.last = *update;
        ++entry->second.updates;
      } else if (const auto* merged = std::get_if<ObjectMerged>(&event)) {
        Remove(merged->from, fmt::format("merged into {}", merged->into.ToString()));
      } else if (const auto* removed = std::get_if<ObjectRemoved>(&event)) {
        Remove(removed->id, fmt::format("removed: {}", removed->reason));
      }
    }
    for (const ObjectViews& views : output.views) {
      PublishedObject& object = run_.objects[views.object];
      object.views += views.new_views.size();
      ++object.cuboid_changes;
    }
  }

  void Remove(ObjectId id, const std::string& reason) {
    run_.removals.push_back(fmt::format("frame {}: {} {}", run_.frames, id.ToString(), reason));
    run_.objects.erase(id);
  }

  session::Ingest ingest_;
  MaskDamager damager_;
  slam::LocalMapSlot local_map_;
  slam::Tracker tracker_;
  slam::SparseMapper sparse_mapper_;
  objects::ObjectMapper object_mapper_;
  std::vector<Tracked> tracked_;
  ObjectRun run_;
};

}  // namespace

std::vector<ObjectUpdate> ObjectRun::Confirmed() const {
  std::vector<ObjectUpdate> confirmed;
  for (const auto& [id, object] : objects) {
    if (object.last.state == ObjectState::kConfirmed) confirmed.push_back(object.last);
  }
  return confirmed;
}

absl::StatusOr<ObjectRun> RunObjects(const files::Sequence& sequence, const ObjectRunOptions& options) {
  Runner runner(sequence, options);
  for (size_t i = 0; i < sequence.size(); ++i) {
    ROMAP_ASSIGN_OR_RETURN(const FrameInput input, sequence.Load(i));
    ROMAP_RETURN_IF_ERROR(runner.Process(input));
  }
  return runner.Finish();
}

}  // namespace romap::measure
