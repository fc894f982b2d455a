#include "tests/bench/training_scene.h"

#include <memory>
#include <utility>

#include "tests/support/synthetic_world.h"

namespace romap::measure {
namespace {

constexpr int kViews = 25;

}  // namespace

TrainingScene SyntheticTrainingScene() {
  SyntheticWorldOptions options;
  options.width_px = 640;
  options.height_px = 480;
  options.focal_px = 800;
  options.frames = kViews;
  options.permute_labels = false;
  const SyntheticWorld world(options);
  TrainingScene scene;
  for (int i = 0; i < world.frame_count(); ++i) {
    const TrackedFrame tracked = world.MakeFrame(i);
    Frame frame = *tracked.frame;
    frame.frame_id = static_cast<uint64_t>(i) + 1;
    frame.T_world_camera = tracked.T_world_camera;
    scene.frames.push_back(std::make_shared<const Frame>(std::move(frame)));
  }
  for (size_t i = 0; i < world.objects().size(); ++i) {
    const Cuboid cuboid = world.TrueCuboid(static_cast<int>(i));
    files::ObjectRecord record;
    record.id = static_cast<int64_t>(i) + 1;
    record.name = record.class_name = world.objects()[i].class_name;
    record.T_world_object = cuboid.T_world_object;
    record.half_extents = cuboid.half_extents;
    scene.objects.push_back(std::move(record));
  }
  return scene;
}

absl::StatusOr<TrainingScene> LoadTrainingScene(const std::string& path) {
  if (path.empty()) return SyntheticTrainingScene();
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence, files::Sequence::Open(path, {}));
  ROMAP_ASSIGN_OR_RETURN(bench::TrueFrames frames, bench::LoadTrueFrames(sequence, 4, 0));
  return TrainingScene{std::move(frames), sequence.objects()->objects};
}

}  // namespace romap::measure
