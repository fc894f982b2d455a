#pragma once

#include <opencv2/core/mat.hpp>
#include <span>

#include "common/camera_model.h"
#include "common/cuboid.h"
#include "common/geometry.h"
#include "common/map_events.h"
#include "common/mesh.h"

namespace romap::pictures {

// Pictures of maps for people to look at. Cameras are free of distortion, images are CV_8UC3 in BGR, meshes are in the
// World frame, lengths in map units.

// The colour that stands for an object in all pictures: neighbours in id differ well. B, G, R of 0..255.
cv::Scalar ObjectColorBgr(ObjectId id);

// Draws each object's cuboid as a wireframe with its label, such as "cup #3", in the object's colour. Edges end where
// they come closer than one thousandth of the cuboid's size to the camera; what is behind the camera is not drawn.
// Lost objects are left out.
void DrawCuboids(cv::Mat& image_bgr, const CameraModel& camera, const SE3<World, Camera>& T_world_camera,
                 std::span<const ObjectUpdate> objects);

// Three square panels side by side: what the camera saw of the object, its mesh shaded in grey, and its mesh in its own
// colours, all from the same pose and cut to the same square around the object. `view_bgr` has the camera's size.
// `cuboid` may be null; if given its outline is drawn over the first panel. When neither mesh nor cuboid is in front of
// the camera, the panels show the whole view and nothing.
cv::Mat DrawMeshBesideView(const Mesh& mesh_world, const cv::Mat& view_bgr, const CameraModel& camera,
                           const SE3<World, Camera>& T_world_camera, const Cuboid* cuboid, int panel_side_px = 320);

// All meshes in their colours and all cuboids, seen from above at an angle and fitted into the picture. `up_world` has
// unit length. Without meshes and cuboids the picture is empty (white).
cv::Mat DrawOverview(std::span<const Mesh> meshes_world, std::span<const ObjectUpdate> objects,
                     const Eigen::Vector3d& up_world, const cv::Size& size_px = {960, 720});

}  // namespace romap::pictures
