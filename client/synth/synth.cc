#include "client/synth/synth.h"

#include <cmath>
#include <filesystem>
#include <memory>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "client/files/camera_yaml.h"
#include "client/files/objects_yaml.h"
#include "client/files/ply.h"
#include "client/files/text_file.h"
#include "client/files/tum.h"
#include "client/synth/camera_path.h"
#include "client/synth/faults.h"
#include "client/synth/frame_plan.h"
#include "client/synth/frame_renderer.h"
#include "client/synth/ground_truth.h"
#include "client/synth/lighting.h"
#include "client/synth/overlays.h"
#include "client/synth/scene.h"
#include "client/synth/shutter.h"
#include "client/synth/synth_camera.h"
#include "common/file_status.h"
#include "common/parallel_for.h"

namespace romap::synth {
namespace {

constexpr double kDepthUnit_m = 1e-4;
constexpr double kTypicalDepth_m = 1;  // of the scene, for the length of the motion blur

absl::Status MakeFolders(const std::string& dir) {
  // Not recursive: a missing parent of `dir` is probably a typing error.
  std::error_code error;
  std::filesystem::create_directory(dir, error);
  if (error) return FileError(dir, "create", error);
  for (const char* name : {"rgb", "mask", "depth", "gt", "gt_mesh"}) {
    ROMAP_RETURN_IF_ERROR(files::MakeFolder(dir + "/" + name));
  }
  return absl::OkStatus();
}

absl::Status WriteImage(const std::string& path, const cv::Mat& image, const std::vector<int>& parameters) {
  std::vector<uint8_t> bytes;
  const std::string extension = std::filesystem::path(path).extension();
  try {
    if (!cv::imencode(extension, image, bytes, parameters)) return Internal("{}: cannot encode the image", path);
  } catch (const cv::Exception& e) {
    return Internal("{}: cannot encode the image: {}", path, e.what());
  }
  return files::WriteFile(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

cv::Mat DepthUnits(const cv::Mat& depth_m) {
  cv::Mat units(depth_m.size(), CV_16UC1);
  for (int v = 0; v < depth_m.rows; ++v) {
    for (int u = 0; u < depth_m.cols; ++u) {
      const long value = std::lround(depth_m.at<float>(v, u) / kDepthUnit_m);
      // Depths beyond 16 bits are unknown.
      units.at<uint16_t>(v, u) = value > 65535 ? uint16_t{0} : static_cast<uint16_t>(value);
    }
  }
  return units;
}

// Renders and writes the frames in parallel.
class SequenceMaker {
 public:
  SequenceMaker(const SynthOptions& options, const std::string& dir, const Scene& scene)
      : options_(options),
        dir_(dir),
        scene_(scene),
        camera_(SynthCamera(options)),
        renderer_(scene, camera_),
        overlays_(options, camera_),
        motion_(options, scene, UncroppedCamera(options)) {
    for (int i = 0; i < options.frames; ++i) path_.push_back(motion_.Pose(i));
    plans_ = PlanFrames(options);
    detections_.resize(path_.size());
    for (const SceneObject& object : scene.objects) {
      surfaces_.push_back(std::make_unique<SurfacePoints>(object, options.seed));
    }
  }

  absl::Status MakeFrames(const std::function<void(int, int)>& progress) {
    std::mutex mutex;
    absl::Status status;
    int done = 0;
    ParallelFor(options_.frames, [&](int i) {
      {
        const std::lock_guard lock(mutex);
        if (!status.ok()) return;
      }
      const absl::Status frame_status = MakeFrame(i);
      const std::lock_guard lock(mutex);
      status.Update(frame_status);
      ++done;
      if (progress && status.ok()) progress(done, options_.frames);
    });
    return status;
  }

  absl::Status WriteTables() const {
    ROMAP_RETURN_IF_ERROR(files::WriteCameraYaml(dir_ + "/camera.yaml", {camera_, options_.fps, kDepthUnit_m}));
    ROMAP_RETURN_IF_ERROR(WriteList("rgb", ImageExtension()));
    ROMAP_RETURN_IF_ERROR(WriteList("mask", ".png"));
    ROMAP_RETURN_IF_ERROR(WriteList("depth", ".png"));
    std::vector<files::StampedPose> poses;
    std::string detections = "timestamp,label,class,score\n";
    for (size_t i = 0; i < path_.size(); ++i) {
      const FramePlan& plan = plans_[i];
      if (plan.missing) continue;
      poses.push_back({Timestamp_ns(i), path_[plan.shown]});
      for (const SynthDetection& detection : detections_[plan.shown]) {
        detections += fmt::format("{},{},{},{:.3f}\n", files::FormatSeconds(Timestamp_ns(i)), detection.label,
                                  scene_.objects[detection.object - 1U].solid.class_name, detection.score);
      }
    }
    ROMAP_RETURN_IF_ERROR(files::WriteFile(dir_ + "/detections.csv", detections));
    return files::WriteTum(dir_ + "/groundtruth.txt", poses);
  }

  absl::Status WriteObjectTruth() const {
    files::ObjectsYaml records;
    for (const SceneObject& object : scene_.objects) {
      records.objects.push_back(
          {object.label, object.name, object.solid.class_name, object.T_world_object, object.half_extents_m, {}});
      ROMAP_RETURN_IF_ERROR(files::WritePly(dir_ + "/gt_mesh/" + object.name + ".ply", TrueMesh(object)));
      const SurfacePoints& surface = *surfaces_[object.label - 1U];
      Mesh cloud;
      cloud.vertices = surface.positions_world();
      cloud.normals = surface.normals_world();
      std::vector<double> seen(cloud.vertices.size());
      std::vector<double> source(cloud.vertices.size());
      for (size_t i = 0; i < seen.size(); ++i) {
        seen[i] = surface.seen(i) ? 1 : 0;
        source[i] = surface.underside(i) ? 2 : 0;
      }
      ROMAP_RETURN_IF_ERROR(
          files::WritePly(dir_ + "/gt/" + object.name + ".ply", cloud, {{"seen", seen}, {"source", source}}));
    }
    return files::WriteObjects(dir_ + "/objects.yaml", records);
  }

 private:
  absl::Status MakeFrame(int i) {
    const FramePlan& plan = plans_[static_cast<size_t>(i)];
    if (plan.missing || plan.shown != static_cast<size_t>(i)) return absl::OkStatus();
    const ImagePoses poses = PosesOfImage(motion_, camera_, options_, i);
    TrueFrame frame = renderer_.Render(poses, PosesDuringExposure(motion_, camera_, options_, i, kTypicalDepth_m));
    overlays_.Apply(i, frame);
    const cv::Vec2d motion_px = SceneMotion(static_cast<size_t>(i), CenterDepth_m(frame.depth_m));
    if (plan.black) {
      frame.labels.setTo(0);
      frame.depth_m.setTo(0);
    }
    for (const auto& surface : surfaces_) surface->MarkSeen(frame, camera_, poses);

    // One random stream per frame, because frames are rendered in any order.
    Random random(options_.seed, 100000U + static_cast<uint64_t>(i));
    const FaultyMask mask = DegradeMask(frame.labels, static_cast<int>(scene_.objects.size()), options_, random);
    DegradeImage(frame.color_bgr, motion_px, options_, random, plan);
    DegradeDepth(frame.depth_m, options_, random);
    detections_[static_cast<size_t>(i)] = mask.detections;

    const std::vector<int> fast_png = {cv::IMWRITE_PNG_COMPRESSION, 2};
    const std::vector<int> jpeg = {cv::IMWRITE_JPEG_QUALITY, options_.jpeg_quality};
    ROMAP_RETURN_IF_ERROR(WriteImage(dir_ + "/" + FrameFile("rgb", i, ImageExtension()), frame.color_bgr,
                                     options_.format == ImageFormat::kPng ? fast_png : jpeg));
    ROMAP_RETURN_IF_ERROR(WriteImage(dir_ + "/" + FrameFile("mask", i, ".png"), mask.labels, fast_png));
    return WriteImage(dir_ + "/" + FrameFile("depth", i, ".png"), DepthUnits(frame.depth_m), fast_png);
  }

  // Depth at the image center [m]; 1 for the background.
  static double CenterDepth_m(const cv::Mat& depth_m) {
    const float center_m = depth_m.at<float>(depth_m.rows / 2, depth_m.cols / 2);
    return center_m > 0 ? center_m : 1;
  }

  // Motion of the image content near the image center at frame i [px/frame].
  cv::Vec2d SceneMotion(size_t i, double depth_m) const {
    if (path_.size() < 2) return {0, 0};
    const size_t from = i + 1 < path_.size() ? i : i - 1;
    const Eigen::Vector3d center_world = path_[from] * Eigen::Vector3d(0, 0, depth_m);
    const Eigen::Vector2d before = camera_.Project(path_[from].Inverse() * center_world);
    const Eigen::Vector2d after = camera_.Project(path_[from + 1].Inverse() * center_world);
    // On an orbit the center is stationary and closer points move, so average the motion at both depths.
    const Eigen::Vector3d near_world = center_world + 0.3 * (path_[from].translation() - center_world);
    const Eigen::Vector2d near_before = camera_.Project(path_[from].Inverse() * near_world);
    const Eigen::Vector2d near_after = camera_.Project(path_[from + 1].Inverse() * near_world);
    const Eigen::Vector2d motion = 0.5 * (after - before + near_after - near_before);
    return {motion.x(), motion.y()};
  }

  int64_t Timestamp_ns(size_t i) const { return std::llround(static_cast<double>(i) * 1e9 / options_.fps); }

  const char* ImageExtension() const { return options_.format == ImageFormat::kPng ? ".png" : ".jpg"; }

  static std::string FrameFile(const char* folder, int i, const char* extension) {
    return fmt::format("{}/{:06d}{}", folder, i + 1, extension);
  }

  absl::Status WriteList(const char* folder, const char* extension) const {
    std::string lines = fmt::format("# {} images, synthetic, seed {}\n# timestamp filename\n", folder, options_.seed);
    for (size_t i = 0; i < plans_.size(); ++i) {
      if (plans_[i].missing) continue;
      lines += fmt::format("{} {}\n", files::FormatSeconds(Timestamp_ns(i)),
                           FrameFile(folder, static_cast<int>(plans_[i].shown), extension));
    }
    return files::WriteFile(fmt::format("{}/{}.txt", dir_, folder), lines);
  }

  const SynthOptions& options_;
  const std::string& dir_;
  const Scene& scene_;
  const CameraModel camera_;
  const FrameRenderer renderer_;
  const Overlays overlays_;
  const CameraPath motion_;
  std::vector<SE3<World, Camera>> path_;  // pose of each frame in the ground truth
  std::vector<FramePlan> plans_;
  std::vector<std::vector<SynthDetection>> detections_;   // per frame
  std::vector<std::unique_ptr<SurfacePoints>> surfaces_;  // per object
};

}  // namespace

absl::Status MakeSequence(const SynthOptions& options, const std::string& dir,
                          const std::function<void(int done, int total)>& progress) {
  ROMAP_RETURN_IF_ERROR(ValidateSynthOptions(options));
  ROMAP_RETURN_IF_ERROR(MakeFolders(dir));
  SceneOptions scene_options{.seed = options.seed,
                             .objects = options.objects,
                             .identical_pairs = options.identical_pairs,
                             .surroundings = options.surroundings};
  if (options.path == PathKind::kTwoRounds) {
    scene_options.min_room_half_m = kTwoRoundsRoomHalf_m;
    scene_options.plain_wall = true;
  }
  Scene scene = MakeScene(scene_options);
  BakeLight(scene);
  SequenceMaker maker(options, dir, scene);
  ROMAP_RETURN_IF_ERROR(maker.MakeFrames(progress));
  ROMAP_RETURN_IF_ERROR(maker.WriteTables());
  return maker.WriteObjectTruth();
}

}  // namespace romap::synth
