#pragma once

#include <string>
#include <vector>

namespace romap::eval {

struct TrajectoryReport;

enum class VerdictLevel { kGood, kDegraded, kWrong };

std::string ToString(VerdictLevel level);

struct Verdict {
  VerdictLevel level = VerdictLevel::kGood;
  std::vector<std::string> reasons;  // of the level; for GOOD the main figures
};

// Judges a trajectory by the thresholds in verdict.cc. The worst figure decides. If the true camera hardly moves, only
// rotation and tracked frames are judged.
Verdict Judge(const TrajectoryReport& report);

// One line: "trajectory verdict: WRONG: reason; reason".
std::string FormatLine(const Verdict& verdict);

}  // namespace romap::eval
