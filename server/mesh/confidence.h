#pragma once

#include <Eigen/Core>
#include <span>

#include "common/field_snapshot.h"
#include "common/mesh.h"

namespace romap::mesh {

// Sets mesh.confidence: how well the views observed each vertex of a closed mesh with normals (Object frame).
//
// A view observes a vertex when the vertex faces it, projects onto a pixel of the object (RayKind::kObject), and
// nothing of the mesh is clearly in front of it (a depth buffer of the vertices, about as coarse as the mesh, decides).
// It then adds the weight
//   w = cos(angle between normal and sight) * min(1, size / 64 px),
// with `size` the pixels that the longest side of the box would have at that distance. The confidence is
// 1 - exp(-sum of w / 2): 0 = no view observes it; one sharp view from the front gives 0.39, five give 0.92.
//
// Of more than 16 views, 16 stand for all.
//
// `cell_mu` is the longest distance between neighbouring vertices along an axis. Views whose pose or camera is not
// finite observe nothing.
void SetConfidence(std::span<const TrainingCamera> views, const Eigen::Vector3f& box_half_extents, float cell_mu,
                   Mesh& mesh);

// Leaves out triangles all of whose vertices have a confidence below `least`, and vertices without triangles. What is
// left may be open, or empty. mesh.confidence must be set.
void TrimUnseen(float least, Mesh& mesh);

}  // namespace romap::mesh
