#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/mesh.h"
#include "common/mesh_faces.h"
#include "server/texture/mesh_edges.h"

namespace romap::texture {

inline constexpr uint32_t kNoCluster = kNoFace;

// Clusters of connected triangles with similar normals.
struct NormalClusters {
  std::vector<uint32_t> of_face;  // kNoCluster: in no cluster
  std::vector<uint32_t> seed;     // of each cluster, the triangle that it grew from
};

// The mean normals of each triangle and its neighbors, after `passes` passes of averaging.
std::vector<Eigen::Vector3f> SmoothFaceNormals(const std::vector<FaceNeighbors>& neighbors, const FaceShapes& shapes,
                                               int passes);

// Grows clusters within `max_angle_rad` of their mean normal, then moves their centers and borders until each triangle
// is in about the cluster with the nearest normal that it is connected to.
NormalClusters ClusterNormals(const Mesh& mesh, const std::vector<FaceNeighbors>& neighbors, const FaceShapes& shapes,
                              const std::vector<Eigen::Vector3f>& normals, float max_angle_rad);

}  // namespace romap::texture
