#include "server/texture/pack_charts.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace romap::texture {
namespace {

// A horizontal part of the skyline, from x0 to the next part.
struct SkylineStep {
  int x0;
  int y;
};

class Skyline {
 public:
  explicit Skyline(int side_px) : side_px_(side_px), steps_({{0, 0}}) {}

  // The corner of a new rectangle; nullopt: no room.
  std::optional<Eigen::Vector2i> Place(const Eigen::Vector2i& size) {
    int best_y = std::numeric_limits<int>::max();
    size_t best = 0;
    for (size_t i = 0; i < steps_.size(); ++i) {
      const int y = TopAt(i, size.x());
      if (y < best_y && y + size.y() <= side_px_) {
        best_y = y;
        best = i;
      }
    }
    if (best_y == std::numeric_limits<int>::max()) return std::nullopt;
    const Eigen::Vector2i corner(steps_[best].x0, best_y);
    Raise(best, size.x(), best_y + size.y());
    return corner;
  }

 private:
  // The lowest free y of a rectangle that begins at a step; beyond the side if it is too wide.
  int TopAt(size_t first, int width) const {
    const int end = steps_[first].x0 + width;
    if (end > side_px_) return side_px_ + 1;
    int y = 0;
    for (size_t i = first; i < steps_.size() && steps_[i].x0 < end; ++i) y = std::max(y, steps_[i].y);
    return y;
  }

  void Raise(size_t first, int width, int y) {
    const int begin = steps_[first].x0, end = begin + width;
    size_t last = first;  // the last step under the rectangle
    while (last + 1 < steps_.size() && steps_[last + 1].x0 < end) ++last;
    const int y_after = steps_[last].y;
    const auto at = [&](size_t i) { return steps_.begin() + static_cast<std::ptrdiff_t>(i); };
    const bool has_rest = end < side_px_ && (last + 1 == steps_.size() || steps_[last + 1].x0 > end);
    steps_.erase(at(first), at(last + 1));
    if (has_rest) steps_.insert(at(first), {end, y_after});
    steps_.insert(at(first), {begin, y});
  }

  int side_px_;
  std::vector<SkylineStep> steps_;
};

}  // namespace

std::optional<PackedRects> PackRects(std::span<const Eigen::Vector2i> sizes_px, int side_px) {
  std::vector<size_t> order(sizes_px.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return sizes_px[a].y() != sizes_px[b].y() ? sizes_px[a].y() > sizes_px[b].y() : sizes_px[a].x() > sizes_px[b].x();
  });
  PackedRects packed;
  packed.corner_px.resize(sizes_px.size());
  Skyline skyline(side_px);
  for (const size_t i : order) {
    const std::optional<Eigen::Vector2i> corner = skyline.Place(sizes_px[i]);
    if (!corner.has_value()) return std::nullopt;
    packed.corner_px[i] = *corner;
  }
  return packed;
}

}  // namespace romap::texture
