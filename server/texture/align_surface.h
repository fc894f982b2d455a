#pragma once

#include <span>

#include "common/mesh.h"
#include "server/texture/texture_view.h"

namespace romap::texture {

struct SurfaceAlignment {
  double moved_share = 0;  // of the vertices: those whose place the images determine
  double mean_mu = 0;      // mean distance by which these moved, along their normals (outward > 0)
};

// Moves the vertices of a mesh along their normals to where the views agree best about the colors. The surface of a
// trained field is off by a few pixels in places, because its density rises over some distance; a texture on such a
// surface is blurred, and shifted in other views.
//
// For each vertex, several distances are tried within a few pixels of the views that show it best. The cost of a
// distance is the variance of the details of the images (without their low frequencies, so that exposure and slow
// changes of the lighting do not matter) over these views, averaged over the neighborhood of the vertex: plane sweeping
// (Collins 1996) along the normals, with costs filtered on the mesh. Distances count by how clear their minimum is, and
// are smoothed by these weights. Vertices without details around them stay.
//
// The mesh (Object frame) needs normals, and vertices that are evenly spread; its triangles stay. The normals are not
// updated. Views must be valid (ValidateTextureView).
SurfaceAlignment AlignSurface(std::span<const TrainingCamera> views, Mesh& mesh);

}  // namespace romap::texture
