#pragma once

#include <span>
#include <string>
#include <vector>

#include "tests/bench/object_score.h"

namespace romap::measure {

// One run over a sequence.
struct ScoredRun {
  int seed = 1;
  MapScore score;
  double tracked_share = 0;  // of the frames
};

// The runs over a sequence with masks that are damaged alike, one per seed.
struct DamageRuns {
  std::string damage;  // title of the table's row
  std::vector<ScoredRun> runs;
};

struct SequenceRuns {
  std::string sequence;
  std::vector<DamageRuns> rows;  // the first one is what the others are compared with
};

// Markdown tables. IoU, centre errors and yaw errors are means over the objects that were found, in all runs together
// (of the yaw the median: round things have none).

// A line per sequence: its first row.
std::string SequencesTable(std::span<const SequenceRuns> sequences);
// A line per damage, all sequences together; the sequences have the same rows. Found objects are summed over the
// sequences for each seed.
std::string DamageTable(std::span<const SequenceRuns> sequences);
// A line per true object.
std::string ObjectsTable(const DamageRuns& row);
// A line per object of one map: what it is said to be and where, and what it is.
std::string MapTable(const MapScore& score);
// What is missing or extra, a line for each run that is not perfect; empty when all are. Of many extra objects the
// first few are named.
std::string FaultList(std::span<const SequenceRuns> sequences);

}  // namespace romap::measure
