#include "server/mesh/confirmed_space.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/mesh/view_pixels.h"

namespace romap::mesh {
namespace {

// What is thinner is no matter and hides nothing: e^-6 of the surface's density.
constexpr float kThin = -6.0f;
constexpr int kStep = 6;  // nodes between the places of the first look
// More views say little more.
constexpr size_t kMostViews = 32;

// What the views show at a place.
struct Tally {
  int held = 0;    // views whose image holds the place; of those:
  int object = 0;  // show the object
  int other = 0;   // show neither the object nor background

  bool IsDoubtful() const { return 2 * other > held; }
};

class Census {
 public:
  explicit Census(std::span<const TrainingCamera> views) {
    const size_t asked = std::min(views.size(), kMostViews);
    for (size_t i = 0; i < asked; ++i) {
      const TrainingCamera& view = views[i * views.size() / asked];
      if (!view.T_camera_object.IsFinite()) continue;
      const auto fx_px = static_cast<float>(view.camera.fx_px), fy_px = static_cast<float>(view.camera.fy_px);
      const auto cx_px = static_cast<float>(view.camera.cx_px), cy_px = static_cast<float>(view.camera.cy_px);
      const Eigen::Matrix3f K{{fx_px, 0, cx_px}, {0, fy_px, cy_px}, {0, 0, 1}};
      cameras_.push_back({K * view.T_camera_object.RotationMatrix().cast<float>(),
                          K * view.T_camera_object.translation().cast<float>(),
                          static_cast<float>(view.camera.width_px) - 0.5f,
                          static_cast<float>(view.camera.height_px) - 0.5f, &view});
    }
  }

  Tally At(const Eigen::Vector3f& p_object) const {
    Tally tally;
    for (const Camera& camera : cameras_) {
      const Eigen::Vector3f p = camera.KR * p_object + camera.Kt;
      const float u_px = p.x() / p.z(), v_px = p.y() / p.z();
      // False for what is not a number, too.
      if (!(p.z() > 0 && u_px > -0.5f && u_px < camera.right_px && v_px > -0.5f && v_px < camera.bottom_px)) continue;
      const std::optional<RayKind> kind = KindAt(*camera.view, u_px, v_px);
      ++tally.held;
      tally.object += kind == RayKind::kObject ? 1 : 0;
      tally.other += kind != RayKind::kObject && kind != RayKind::kBackground ? 1 : 0;
    }
    return tally;
  }

 private:
  struct Camera {
    Eigen::Matrix3f KR;  // Object frame to pixels times depth
    Eigen::Vector3f Kt;
    float right_px, bottom_px;  // where the image ends
    const TrainingCamera* view;
  };
  std::vector<Camera> cameras_;
};

// Node 1 + kStep * (x, y, z) of the grid is place (x, y, z), and may lie beyond the box.
struct Lattice {
  Eigen::Vector3i count;
  std::vector<uint8_t> doubtful;  // x fastest

  bool AnyAround(int x, int y, int z) const {
    bool any = false;
    for (int corner = 0; corner < 8; ++corner) {
      const int row = (z + (corner >> 2)) * count.y() + y + (corner >> 1 & 1);
      any |= doubtful[static_cast<size_t>(row * count.x() + x + (corner & 1))] != 0;
    }
    return any;
  }
};

Lattice LookAround(const Census& census, const FieldGrid& grid) {
  Lattice lattice;
  lattice.count = (grid.nodes.array() - 3) / kStep + 2;  // so that each node lies in a cell before the last place
  for (int z = 0; z < lattice.count.z(); ++z) {
    for (int y = 0; y < lattice.count.y(); ++y) {
      for (int x = 0; x < lattice.count.x(); ++x) {
        const Eigen::Vector3i node = kStep * Eigen::Vector3i(x, y, z) + Eigen::Vector3i::Ones();
        lattice.doubtful.push_back(census.At(grid.Position(node.cast<float>())).IsDoubtful() ? 1 : 0);
      }
    }
  }
  return lattice;
}

// Looks at each node from `first` on, up to the next place of the lattice.
void EmptyCell(const Census& census, const Eigen::Vector3i& first, double least_share, FieldGrid& grid) {
  const Eigen::Vector3i last = (first.array() + kStep - 1).min(grid.nodes.array() - 2);
  for (int z = first.z(); z <= last.z(); ++z) {
    for (int y = first.y(); y <= last.y(); ++y) {
      for (int x = first.x(); x <= last.x(); ++x) {
        const size_t node = grid.Index(x, y, z);
        if (!(grid.value[node] > kThin)) continue;
        const Tally tally = census.At(grid.Position(Eigen::Vector3i(x, y, z).cast<float>()));
        if (tally.object < least_share * tally.held) grid.Edit(node, kEmpty);
      }
    }
  }
}

}  // namespace

void EmptyUnconfirmed(std::span<const TrainingCamera> views, double least_share, FieldGrid& grid) {
  if (!(least_share > 0)) return;
  const Census census(views);
  const Lattice lattice = LookAround(census, grid);
  for (int z = 0; z + 1 < lattice.count.z(); ++z) {
    for (int y = 0; y + 1 < lattice.count.y(); ++y) {
      for (int x = 0; x + 1 < lattice.count.x(); ++x) {
        if (!lattice.AnyAround(x, y, z)) continue;
        EmptyCell(census, kStep * Eigen::Vector3i(x, y, z) + Eigen::Vector3i::Ones(), least_share, grid);
      }
    }
  }
}

}  // namespace romap::mesh
