#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>

#include "client/render/rasterizer.h"
#include "common/mesh.h"

namespace romap::render {

enum class MeshPaint {
  kShaded,   // gray, lit from near the camera
  kColored,  // unlit texture, or vertex colors; as kShaded for meshes without either
};

// A mesh to draw. Shading uses the vertex normals if the mesh has them, otherwise the triangle normals.
struct MeshInstance {
  const Mesh* mesh = nullptr;  // may be empty
  uint16_t id = 0;             // value in RenderedView::ids, > 0
  Sim3<World, Object> S_world_mesh = {};
  cv::Mat texture_bgr = {};  // CV_8UC3; used if the mesh has `uv`
};

// A rendered view; all images have the size of the camera image.
struct RenderedView {
  cv::Mat color_bgr;  // CV_8UC3, mean of 2x2 samples per pixel
  cv::Mat depth_mu;   // CV_32FC1 z depth at the pixel center, 0 = background
  cv::Mat ids;        // CV_16UC1 id of the mesh at the pixel center, 0 = background
};

// Draws both sides of all triangles over `background_bgr`. Triangles with an index out of range are skipped. `camera`
// must have no distortion.
RenderedView RenderMeshes(std::span<const MeshInstance> meshes, const CameraModel& camera,
                          const SE3<World, Camera>& T_world_camera, MeshPaint paint,
                          const cv::Scalar& background_bgr = cv::Scalar(255, 255, 255));

}  // namespace romap::render
