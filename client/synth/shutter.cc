#include "client/synth/shutter.h"

#include <algorithm>
#include <cmath>

namespace romap::synth {
namespace {

constexpr double kStep_px = 1.5;
constexpr int kMaxMoments = 16;

// The poses `offset_frames` after the middle of the exposure.
ImagePoses PosesAt(const CameraPath& path, const CameraModel& camera, double readout, int frame, double offset_frames) {
  if (readout == 0) return ImagePoses(path.Pose(frame, offset_frames));
  std::vector<SE3<World, Camera>> rows;
  rows.reserve(static_cast<size_t>(camera.height_px));
  for (int v = 0; v < camera.height_px; ++v) {
    const double from_middle = (v - 0.5 * (camera.height_px - 1)) / camera.height_px;
    rows.push_back(path.Pose(frame, offset_frames + readout * from_middle));
  }
  return {camera, std::move(rows)};
}

// The largest motion of image points with the given depth between two poses [px].
double ImageMotion(const CameraModel& camera, const SE3<World, Camera>& from, const SE3<World, Camera>& to,
                   double depth_m) {
  double largest_px = 0;
  for (const double u : {0.0, 0.5, 1.0}) {
    for (const double v : {0.0, 0.5, 1.0}) {
      const Eigen::Vector2d pixel_px(u * camera.width_px, v * camera.height_px);
      const Eigen::Vector3d p = to.Inverse() * (from * (depth_m * camera.Unproject(pixel_px.x(), pixel_px.y())));
      if (p.z() > 0) largest_px = std::max(largest_px, (camera.Project(p) - pixel_px).norm());
    }
  }
  return largest_px;
}

}  // namespace

ImagePoses PosesOfImage(const CameraPath& path, const CameraModel& camera, const SynthOptions& options, int frame) {
  return PosesAt(path, camera, options.readout, frame, 0);
}

std::vector<ImagePoses> PosesDuringExposure(const CameraPath& path, const CameraModel& camera,
                                            const SynthOptions& options, int frame, double depth_m) {
  std::vector<ImagePoses> moments;
  if (options.exposure == 0) return moments;
  const double half = 0.5 * options.exposure;
  const double motion_px = ImageMotion(camera, path.Pose(frame, -half), path.Pose(frame, 0), depth_m) +
                           ImageMotion(camera, path.Pose(frame, 0), path.Pose(frame, half), depth_m);
  const int count = std::min(static_cast<int>(std::ceil(motion_px / kStep_px)), kMaxMoments);
  if (count < 2) return moments;
  for (int k = 0; k < count; ++k) {
    const double offset_frames = options.exposure * ((k + 0.5) / count - 0.5);
    moments.push_back(PosesAt(path, camera, options.readout, frame, offset_frames));
  }
  return moments;
}

}  // namespace romap::synth
