#pragma once

#include <cstdint>
#include <optional>

#include "common/field_snapshot.h"
#include "common/stage_messages.h"

namespace romap::mesh {

// Ray kind that a view's mask has at a pixel of the full image; nullopt outside the view's crop. The coordinates must
// be finite and fit an int.
inline std::optional<RayKind> KindAt(const TrainingCamera& view, float u_px, float v_px) {
  // The coordinate is shifted by a pixel, because truncation would map coordinates just left of the crop to its first
  // column.
  const int x = static_cast<int>(u_px - static_cast<float>(view.roi_px.x) + 1.5f) - 1;
  const int y = static_cast<int>(v_px - static_cast<float>(view.roi_px.y) + 1.5f) - 1;
  if (x < 0 || y < 0 || x >= view.ray_kind.cols || y >= view.ray_kind.rows) return std::nullopt;
  return static_cast<RayKind>(view.ray_kind.ptr<uint8_t>(y)[x]);
}

}  // namespace romap::mesh
