#include "server/texture/pack_charts.h"

#include <stb_rect_pack.h>

#include <cstddef>

namespace romap::texture {

std::optional<PackedRects> PackRects(std::span<const Eigen::Vector2i> sizes_px, int side_px) {
  std::vector<stbrp_node> nodes(static_cast<size_t>(side_px));  // as many as columns, so that they always suffice
  stbrp_context context;
  stbrp_init_target(&context, side_px, side_px, nodes.data(), side_px);
  std::vector<stbrp_rect> rects(sizes_px.size());
  for (size_t i = 0; i < sizes_px.size(); ++i) {
    rects[i].w = sizes_px[i].x();
    rects[i].h = sizes_px[i].y();
  }
  if (stbrp_pack_rects(&context, rects.data(), static_cast<int>(rects.size())) == 0) return std::nullopt;
  PackedRects packed;
  packed.corner_px.reserve(rects.size());
  for (const stbrp_rect& rect : rects) packed.corner_px.emplace_back(rect.x, rect.y);
  return packed;
}

}  // namespace romap::texture
