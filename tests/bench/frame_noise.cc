#include "tests/bench/frame_noise.h"

#include <cmath>
#include <memory>
#include <utility>

#include "client/synth/random.h"
#include "common/angles.h"
#include "tests/support/mask_damage.h"

namespace romap::measure {
namespace {

SE3<World, Camera> PerturbedPose(const SE3<World, Camera>& T_world_camera, const FrameNoise& noise, uint64_t frame_id) {
  synth::Random random(noise.seed, frame_id);
  const auto normals = [&]() -> Eigen::Vector3d {
    const double x = random.Normal(), y = random.Normal();
    return {x, y, random.Normal()};
  };
  const Eigen::Vector3d turn_rad = normals() * noise.pose_deg * kRadPerDeg;
  const Eigen::Vector3d shift_m = normals() * noise.pose_cm / 100;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(turn_rad.norm(), turn_rad.stableNormalized()));
  return {T_world_camera.rotation() * turn, T_world_camera.translation() + shift_m};
}

}  // namespace

bench::TrueFrames WithNoise(const bench::TrueFrames& frames, const FrameNoise& noise) {
  MaskDamager damager({.border_px = noise.mask_px, .seed = noise.seed}, {});
  bench::TrueFrames noisy;
  for (const std::shared_ptr<const Frame>& frame : frames) {
    Frame changed = noise.mask_px > 0 ? *damager.Damage(*frame) : *frame;
    if (noise.pose_deg > 0 || noise.pose_cm > 0) {
      changed.T_world_camera = PerturbedPose(*frame->T_world_camera, noise, frame->frame_id);
    }
    noisy.push_back(std::make_shared<const Frame>(std::move(changed)));
  }
  return noisy;
}

}  // namespace romap::measure
