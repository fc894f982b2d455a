#pragma once

#include <opencv2/core/mat.hpp>
#include <span>

#include "server/texture/surface_texels.h"
#include "server/texture/unwrap_mesh.h"

namespace romap::texture {

// Colors the texels that no view shows. On the surface: the vertex colors of the mesh (gray if it has none) plus the
// difference between texture and vertex colors, which is continued smoothly over the surface from the seen parts, also
// across the borders of charts (membrane interpolation: P. Pérez, M. Gangnet and A. Blake, "Poisson image editing",
// SIGGRAPH 2003). Between charts: mean colors of the surroundings, from near to far (S. J. Gortler et al., "The
// lumigraph", SIGGRAPH 1996), so that smaller versions of the texture and its compression are not disturbed.
//
// color_bgr: CV_8UC3, seen: CV_8UC1, 255 = seen; both of size atlas_px. `texels` are those of the mesh.
void FillUnseen(const TexturedMesh& textured, std::span<const SurfaceTexel> texels, const cv::Mat& seen,
                cv::Mat& color_bgr);

}  // namespace romap::texture
