#pragma once

#include <Eigen/Core>
#include <span>

#include "server/texture/prepared_view.h"

namespace romap::texture {

inline constexpr int kMostSamples = 12;

// The color of a point that several views show. Samples that are far from the weighted median color (highlights,
// objects in front) are rejected. The low frequencies are the mean of all others, so that differences between views
// cause no seams; the high frequencies come from the best few views, so that the texture stays sharp (two bands of
// P. Burt and E. Adelson, "A multiresolution spline with application to image mosaics", TOG 1983). Selecting views by
// quality and rejecting outliers follows M. Waechter, N. Moehrle and M. Goesele, "Let there be color! Large-scale
// texturing of 3D reconstructions", ECCV 2014.
//
// `best_view_power`: exponent of the weights in the high frequencies; the larger it is, the fewer views contribute.
// There must be 1..kMostSamples samples, whose weights are > 0. Gray levels, 0..255.
Eigen::Array3f BlendSamples(std::span<const ViewSample> samples, float best_view_power);

}  // namespace romap::texture
