#pragma once

#include <span>
#include <string>
#include <vector>

#include "tests/bench/object_score.h"

namespace romap {

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
// A line per true object: its first row.
std::string ObjectsTable(const SequenceRuns& sequence);

}  // namespace romap
