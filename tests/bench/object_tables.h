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

// The runs over a sequence with one kind of mask damage, one per seed.
struct DamageRuns {
  std::string damage;  // title of the table's row
  std::vector<ScoredRun> runs;
};

struct SequenceRuns {
  std::string sequence;
  std::vector<DamageRuns> rows;  // the first row is the reference for the others
};

// Markdown tables. IoU and center errors are means over the found objects of all runs; yaw errors are medians, because
// the yaw of round objects is arbitrary.

// One line per sequence, for its first row of runs.
std::string SequencesTable(std::span<const SequenceRuns> sequences);
// One line per kind of damage, over all sequences. All sequences must have the same rows. Found objects are summed over
// the sequences of each seed.
std::string DamageTable(std::span<const SequenceRuns> sequences);
// One line per true object.
std::string ObjectsTable(const DamageRuns& row);
// One line per object of one map: its class and position, and the true object it was matched with.
std::string MapTable(const MapScore& score);
// Missing and extra objects, one line per run that has any. Names only the first extra objects.
std::string FaultList(std::span<const SequenceRuns> sequences);

}  // namespace romap::measure
