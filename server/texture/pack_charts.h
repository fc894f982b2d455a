#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

namespace romap::texture {

struct PackedRects {
  std::vector<Eigen::Vector2i> corner_px;  // upper left corner of each rectangle
};

// Places rectangles (width and height in texels, > 0) in a square without overlap: the tallest first, each as high as
// possible above the skyline of the others (bottom-left heuristic: B. S. Baker, E. G. Coffman and R. L. Rivest,
// "Orthogonal packings in two dimensions", SIAM Journal on Computing 1980). nullopt: not all of them fit.
std::optional<PackedRects> PackRects(std::span<const Eigen::Vector2i> sizes_px, int side_px);

}  // namespace romap::texture
