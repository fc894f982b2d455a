#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>

#include "client/render/rasterizer.h"
#include "common/mesh.h"

namespace romap::render {

enum class MeshPaint {
  kShaded,   // grey, lit from the camera: shows shape
  kColored,  // the vertices' own colours, unlit; grey and lit where a mesh has no colours
};

// A mesh to draw. Normals are used when the mesh has them, else the triangles' own.
struct MeshInstance {
  const Mesh* mesh_world = nullptr;  // vertices in the World frame, map units; may be empty
  uint16_t id = 0;                   // what RenderedView::ids shows, > 0
};

// Images of the size of the camera's.
struct RenderedView {
  cv::Mat color_bgr;  // CV_8UC3, averaged over 2x2 samples a pixel
  cv::Mat depth_mu;   // CV_32FC1 z depth at the pixel's centre, 0 = nothing
  cv::Mat ids;        // CV_16UC1 id of the mesh at the pixel's centre, 0 = nothing
};

// Draws meshes, both sides of every triangle, over `background_bgr`. Triangles with an index out of range are left out.
// `camera` must be free of distortion.
RenderedView RenderMeshes(std::span<const MeshInstance> meshes, const CameraModel& camera,
                          const SE3<World, Camera>& T_world_camera, MeshPaint paint,
                          const cv::Scalar& background_bgr = cv::Scalar(255, 255, 255));

}  // namespace romap::render
