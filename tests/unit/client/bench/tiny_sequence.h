#pragma once

#include <Eigen/Core>
#include <string>

#include "client/files/sequence.h"
#include "tests/support/subprocess.h"

namespace romap::testing {

struct TinyBall {
  int64_t id;
  std::string name;
  Eigen::Vector3d center_world;  // m
  double radius_m;
};

// Two striped balls seen from all around in small frames, with all truth, drawn exactly and written anew by every test.
class TinySequence {
 public:
  static constexpr int kFrames = 24;

  TinySequence();

  std::string dir() const { return folder_ / "sequence"; }
  std::string operator/(const std::string& name) const { return folder_ / name; }
  files::Sequence Open() const;

  static const std::vector<TinyBall>& Balls();

 private:
  testing_support::TemporaryFolder folder_;
};

}  // namespace romap::testing
