#include "server/slam/given_pose_checks.h"

namespace romap::slam {

void GivenPoseChecks::AddFrame(const Frame& frame, const std::shared_ptr<const FrameFeatures>& features,
                               const SE3<World, Camera>& T_world_camera, const cv::Mat& depth_mu) {
  const auto agreeing = poses_.AddFrame(features, T_world_camera);
  if (!agreeing) return;
  depth_.AddPair(frame.camera, *agreeing, depth_mu);
  noise_.AddPair(frame.camera, *agreeing);
  if (!frame.source_gray.empty()) distortion_.AddPair(frame.source_camera, *agreeing);
  focal_.AddPair(frame.camera, *agreeing);
}

std::optional<GivenPoseChecks::Contradiction> GivenPoseChecks::PosesOrCamera() const {
  if (poses_.IsContradicted()) {
    return Contradiction{"the given pose contradicts the images", poses_.contradicted_since_frame()};
  }
  if (noise_.ImagesAreFlipped()) return Contradiction{"the images are flipped", 1};
  if (distortion_.IsContradicted()) {
    return Contradiction{"the lens distortion contradicts the images", distortion_.contradicted_since_frame()};
  }
  if (focal_.IsContradicted()) {
    return Contradiction{"the focal length contradicts the images", focal_.contradicted_since_frame()};
  }
  return std::nullopt;
}

std::vector<Diagnostic> GivenPoseChecks::Diagnostics() const {
  std::vector<Diagnostic> diagnostics;
  // Where there are features, a wrong distortion is like a wrong focal length.
  std::optional<Diagnostic> camera = focal_.Check();
  if (distortion_.IsContradicted() || (camera && distortion_.IsSuspect())) camera = distortion_.Check();
  for (const auto& diagnostic :
       {poses_.Check(), poses_.IsContradicted() ? std::nullopt : camera, noise_.Check(), depth_.Check()}) {
    if (diagnostic) diagnostics.push_back(*diagnostic);
  }
  return diagnostics;
}

}  // namespace romap::slam
