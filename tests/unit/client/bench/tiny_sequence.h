#pragma once

#include <Eigen/Core>
#include <string>

#include "client/files/sequence.h"
#include "tests/support/subprocess.h"

namespace romap::testing_support {

struct TinyBall {
  int64_t id;
  std::string name;
  Eigen::Vector3d center_world;  // m
  double radius_m;
};

// A sequence of small frames around two striped balls, with exact ground truth. Each test writes a new one.
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

}  // namespace romap::testing_support
