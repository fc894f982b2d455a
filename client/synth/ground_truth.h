#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "client/synth/frame_renderer.h"
#include "client/synth/scene.h"
#include "common/mesh.h"

namespace romap::synth {

// Points on one object's surface and which of them some frame saw.
class SurfacePoints {
 public:
  // About one point per square millimetre of the outer surface, at most 60000, spread at random by area. What lies
  // inside another part of the object is no surface and gets no point.
  SurfacePoints(const SceneObject& object, uint64_t seed);

  // Marks the points that the frame shows: they face the camera and are what the depth image has at their pixel, inside
  // the object's mask. Safe to call from several threads; the marks do not depend on the order of calls.
  void MarkSeen(const TrueFrame& frame, const CameraModel& camera, const SE3<World, Camera>& T_world_camera);

  const std::vector<Eigen::Vector3f>& positions_world() const { return positions_world_; }  // metres
  const std::vector<Eigen::Vector3f>& normals_world() const { return normals_world_; }      // unit length
  bool seen(size_t i) const { return seen_[i].load(std::memory_order_relaxed) != 0; }
  // Whether the point is part of the flat side the object stands on, which no camera can see.
  bool underside(size_t i) const { return underside_[i] != 0; }

 private:
  uint8_t label_;
  std::vector<Eigen::Vector3f> positions_world_;
  std::vector<Eigen::Vector3f> normals_world_;
  std::vector<uint8_t> underside_;
  std::vector<std::atomic<uint8_t>> seen_;
};

// The object's parts in one mesh, World frame, metres. Each part is closed; parts may reach into each other.
Mesh TrueMesh(const SceneObject& object);

}  // namespace romap::synth
