#pragma once

#include "common/mesh.h"

namespace romap::mesh {

// Sets unit normals of a mesh whose triangles are counter-clockwise seen from outside: the mean of the adjoining
// triangles' normals, weighted by area, then twice the mean over the triangles around.
//
// They come from the surface and not from the gradient of the field, because a trained field is noisier than its own
// crossing: against true surfaces, normals from central differences are off by 28 degrees in the mean where these are
// off by 20.
void SetVertexNormals(Mesh& mesh);

}  // namespace romap::mesh
