#pragma once

#include <Eigen/Core>
#include <span>

namespace romap::slam {

// One piece of evidence for the up direction of a world. It is either about right (with `reliability`), or has nothing
// to do with up.
struct UpClue {
  enum class Kind {
    kDirection,      // up is about `vector_world`
    kPerpendicular,  // up is about perpendicular to `vector_world`: the normal of a wall
  };
  Kind kind = Kind::kDirection;
  Eigen::Vector3d vector_world = Eigen::Vector3d::UnitZ();  // unit length
  double sigma_rad = 0;                                     // standard deviation, per axis
  double reliability = 0;                                   // 0..1, probability that it is about up at all
};

struct FusedUp {
  Eigen::Vector3d direction_world = Eigen::Vector3d::UnitZ();  // unit length
  double sigma_rad = 0;                                        // standard deviation per axis, if the direction is right
  double confidence = 0;  // 0..1, probability that the direction is right within about three standard deviations
};

// Combines clues, of which some may be wrong: for each set of clues that may be the right ones, computes the most
// likely direction and the probability of the set (a Bayesian mixture: agreement by chance is unlikely, so clues that
// agree confirm each other, and of clues that contradict each other the more reliable ones win). Returns the direction
// of the most probable set; the probabilities of all sets with about the same direction add up to its confidence.
// `guess_world`: up is within about 45 degrees of it, and at most 75 degrees. At most 10 clues are used, those first in
// the list.
FusedUp FuseUp(std::span<const UpClue> clues, const Eigen::Vector3d& guess_world);

}  // namespace romap::slam
