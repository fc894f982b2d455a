#include "server/session/restored_objects.h"

#include <algorithm>
#include <set>
#include <tuple>

namespace romap::session {

std::map<ObjectId, ObjectId> FindRestoredObjects(const std::vector<ObjectUpdate>& stored,
                                                 const std::vector<ObjectUpdate>& made_again) {
  struct Candidate {
    bool class_differs = false;
    double distance_mu = 0;
    ObjectId stored, made_again;
  };
  std::vector<Candidate> candidates;
  for (const ObjectUpdate& a : stored) {
    for (const ObjectUpdate& b : made_again) {
      const double distance_mu = (a.cuboid.T_world_object.translation() - b.cuboid.T_world_object.translation()).norm();
      const double half_diagonal_mu = std::min(a.cuboid.half_extents.norm(), b.cuboid.half_extents.norm());
      if (a.map_id != b.map_id || distance_mu > half_diagonal_mu) continue;
      candidates.push_back({a.class_name != b.class_name, distance_mu, a.id, b.id});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::tie(a.class_differs, a.distance_mu, a.stored, a.made_again) <
           std::tie(b.class_differs, b.distance_mu, b.stored, b.made_again);
  });
  std::map<ObjectId, ObjectId> stored_ids;
  std::set<ObjectId> found;
  for (const Candidate& candidate : candidates) {
    if (found.contains(candidate.stored) || stored_ids.contains(candidate.made_again)) continue;
    found.insert(candidate.stored);
    stored_ids[candidate.made_again] = candidate.stored;
  }
  return stored_ids;
}

}  // namespace romap::session
