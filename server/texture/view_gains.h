#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "server/texture/prepared_view.h"
#include "server/texture/surface_texels.h"

namespace romap::texture {

// How the images of the views differ from each other.
struct ViewGain {
  Eigen::Array3f gain_bgr = Eigen::Array3f::Ones();  // multiply the colors by it to compensate exposure; 0.5..2
  float sharpness = 1;                               // relative to the other views of the same surface, 0.1..2
};

// Gains from the surface that several views show: the logarithms of its color in all views, times their gains, agree
// best (robust least squares). The gains of single views are pulled weakly toward 1, so the mean exposure is kept. The
// method is that for panoramas of M. Brown and D. Lowe, "Automatic panoramic image stitching using invariant features",
// IJCV 2007. Views that share no surface with others get 1.
std::vector<ViewGain> EstimateViewGains(std::span<const PreparedView> views, std::span<const SurfaceTexel> texels);

}  // namespace romap::texture
