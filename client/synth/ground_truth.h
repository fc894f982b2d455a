#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "client/synth/frame_renderer.h"
#include "client/synth/scene.h"
#include "common/mesh.h"

namespace romap::synth {

// Points on the surface of one object, and whether they are visible in some frame.
class SurfacePoints {
 public:
  // Samples about one point per square millimeter of the outer surface, at most 60000, uniformly by area. Excludes
  // points inside another part of the object.
  SurfacePoints(const SceneObject& object, uint64_t seed);

  // Marks the points that are visible in the frame: they face the camera, agree with the depth image at their pixel,
  // and are in the mask of the object. Thread-safe; the result does not depend on the order of calls.
  void MarkSeen(const TrueFrame& frame, const CameraModel& camera, const ImagePoses& poses);

  const std::vector<Eigen::Vector3f>& positions_world() const { return positions_world_; }  // meters
  const std::vector<Eigen::Vector3f>& normals_world() const { return normals_world_; }      // unit length
  bool seen(size_t i) const { return seen_[i].load(std::memory_order_relaxed) != 0; }
  // Whether the point is on the flat side the object stands on, which no camera can see.
  bool underside(size_t i) const { return underside_[i] != 0; }

 private:
  uint8_t label_;
  std::vector<Eigen::Vector3f> positions_world_;
  std::vector<Eigen::Vector3f> normals_world_;
  std::vector<uint8_t> underside_;
  std::vector<std::atomic<uint8_t>> seen_;
};

// All parts of the object as one mesh [World, m]. Each part is closed; parts may overlap.
Mesh TrueMesh(const SceneObject& object);

}  // namespace romap::synth
