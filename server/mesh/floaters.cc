#include "server/mesh/floaters.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "server/mesh/grid_flood.h"

namespace romap {

size_t RemoveFloaters(FieldGrid& grid, float connect_value, double min_share) {
  constexpr uint32_t kNoPiece = 0;
  std::vector<uint32_t> piece_of(grid.value.size(), kNoPiece);
  std::vector<size_t> piece_size = {0};  // nodes inside the surface, by piece; [kNoPiece] unused
  for (size_t seed = 0; seed < grid.value.size(); ++seed) {
    if (!(grid.value[seed] > 0) || piece_of[seed] != kNoPiece) continue;
    const auto piece = static_cast<uint32_t>(piece_size.size());
    piece_of[seed] = piece;
    piece_size.push_back(1);
    Flood(grid, {seed}, [&](size_t node) {
      if (!(grid.value[node] > connect_value) || piece_of[node] != kNoPiece) return false;
      piece_of[node] = piece;
      piece_size[piece] += grid.value[node] > 0;
      return true;
    });
  }

  const auto largest = static_cast<double>(*std::max_element(piece_size.begin(), piece_size.end()));
  size_t remaining = 0;
  for (size_t node = 0; node < piece_of.size(); ++node) {
    if (!(grid.value[node] > 0)) continue;
    const auto size = static_cast<double>(piece_size[piece_of[node]]);
    if (size < min_share * largest) {
      grid.Edit(node, kEmpty);
    } else {
      ++remaining;
    }
  }
  return remaining;
}

}  // namespace romap
