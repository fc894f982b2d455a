#pragma once

#include <opencv2/core/mat.hpp>
#include <span>

#include "client/render/mesh_view.h"
#include "common/camera_model.h"
#include "common/cuboid.h"
#include "common/geometry.h"
#include "common/map_events.h"

namespace romap::pictures {

// Visualization of maps. Cameras have no distortion, images are CV_8UC3 in BGR, and lengths are in map units.

// The color of an object in all images (B, G, R, 0..255). Objects with consecutive ids have clearly different colors.
cv::Scalar ObjectColorBgr(ObjectId id);

// Draws the cuboid of each object as a wireframe in the color of the object, with a label such as "cup #3". Parts
// behind the camera or closer than one thousandth of the cuboid size are clipped. Lost objects are skipped.
void DrawCuboids(cv::Mat& image_bgr, const CameraModel& camera, const SE3<World, Camera>& T_world_camera,
                 std::span<const ObjectUpdate> objects);

// Draws three square panels side by side: the camera image of the object, its mesh shaded in gray, and its mesh with
// vertex colors, all from the same pose and cropped to the same square around the object. `view_bgr` has the size of
// the camera image. If `cuboid` is not null, its wireframe is drawn over the first panel. If neither mesh nor cuboid is
// in front of the camera, the first panel shows the whole image and the others are empty.
cv::Mat DrawMeshBesideView(const render::MeshInstance& mesh, const cv::Mat& view_bgr, const CameraModel& camera,
                           const SE3<World, Camera>& T_world_camera, const Cuboid* cuboid, int panel_side_px = 320);

// Draws all meshes with vertex colors and all cuboids, from an elevated viewpoint that fits everything into the image.
// `up_world` has unit length. White if there are no meshes and no cuboids.
cv::Mat DrawOverview(std::span<const render::MeshInstance> meshes, std::span<const ObjectUpdate> objects,
                     const Eigen::Vector3d& up_world, const cv::Size& size_px = {960, 720});

}  // namespace romap::pictures
