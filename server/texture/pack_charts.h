#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

namespace romap::texture {

struct PackedRects {
  std::vector<Eigen::Vector2i> corner_px;  // upper left corner of each rectangle
};

// Places rectangles (width and height in texels, > 0) in a square without overlap (stb_rect_pack: skyline bottom-left
// heuristic). nullopt: not all of them fit.
std::optional<PackedRects> PackRects(std::span<const Eigen::Vector2i> sizes_px, int side_px);

}  // namespace romap::texture
