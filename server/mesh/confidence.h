#pragma once

#include <Eigen/Core>
#include <span>

#include "common/field_snapshot.h"
#include "common/mesh.h"

namespace romap::mesh {

// Sets mesh.confidence: how well the views observed each vertex of a closed mesh with normals (Object frame).
//
// A view observes a vertex if the vertex faces it, projects to a pixel of the object (RayKind::kObject), and no part of
// the mesh is clearly in front of it (tested with a depth buffer of the vertices, about as coarse as the mesh). Each
// such view adds the weight
//   w = cos(angle between the normal and the direction to the view) * min(1, size / 64 px),
// where `size` is the length in pixels that the longest side of the box would have at that distance. The confidence is
// 1 - exp(-sum of w / 2): 0 = not observed; one sharp view from the front gives 0.39, five give 0.92.
//
// If there are more than 16 views, 16 of them are used and weighted for all.
//
// `cell_mu` is the longest distance between neighboring vertices along an axis. Views whose pose or camera is not
// finite are ignored.
void SetConfidence(std::span<const TrainingCamera> views, const Eigen::Vector3f& box_half_extents, float cell_mu,
                   Mesh& mesh);

// Removes the triangles all of whose vertices have a confidence below `min_confidence`, and vertices without triangles.
// The result may be open or empty. mesh.confidence must be set.
void TrimUnseen(float min_confidence, Mesh& mesh);

}  // namespace romap::mesh
