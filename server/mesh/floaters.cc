#include "server/mesh/floaters.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "server/mesh/grid_flood.h"

namespace romap {

size_t RemoveFloaters(FieldGrid& grid, float level, float connect_level, double min_share) {
  constexpr uint32_t kNoPiece = 0;
  std::vector<uint32_t> piece_of(grid.raw.size(), kNoPiece);
  std::vector<size_t> piece_size = {0};  // nodes above `level`, by piece; [kNoPiece] unused
  for (size_t seed = 0; seed < grid.raw.size(); ++seed) {
    if (!(grid.raw[seed] > level) || piece_of[seed] != kNoPiece) continue;
    const auto piece = static_cast<uint32_t>(piece_size.size());
    piece_of[seed] = piece;
    piece_size.push_back(1);
    Flood(grid, {seed}, [&](size_t node) {
      if (!(grid.raw[node] > connect_level) || piece_of[node] != kNoPiece) return false;
      piece_of[node] = piece;
      piece_size[piece] += grid.raw[node] > level;
      return true;
    });
  }

  const auto largest = static_cast<double>(*std::max_element(piece_size.begin(), piece_size.end()));
  size_t remaining = 0;
  for (size_t node = 0; node < piece_of.size(); ++node) {
    if (!(grid.raw[node] > level)) continue;
    const auto size = static_cast<double>(piece_size[piece_of[node]]);
    if (size < min_share * largest) {
      grid.raw[node] = kEmptyRaw;
    } else {
      ++remaining;
    }
  }
  return remaining;
}

}  // namespace romap
