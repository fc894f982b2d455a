#include "tests/bench/object_tables.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/statistics.h"

namespace romap::measure {
namespace {

struct Range {
  size_t least = SIZE_MAX;
  size_t most = 0;

  void Add(size_t value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
  std::string Text() const { return least == most ? fmt::format("{}", most) : fmt::format("{}..{}", least, most); }
};

// Results of several runs.
class Summary {
 public:
  // One map per sequence, all of one seed.
  void Add(std::span<const MapScore* const> maps) {
    size_t found = 0, extra = 0, total = 0;
    for (const MapScore* map : maps) {
      total += map->objects.size();
      found += map->Found();
      extra += map->Extra();
      for (const TrueObject& object : map->objects) {
        if (object.found) AddErrors(object.errors);
      }
    }
    total_ = total;
    found_.Add(found);
    extra_.Add(extra);
  }

  void AddErrors(const ObjectErrors& errors) {
    iou_sum_ += errors.iou;
    lowest_iou_ = std::min(lowest_iou_, errors.iou);
    center_sum_cm_ += errors.center_cm;
    in_plane_sum_cm_ += errors.in_plane_cm;
    yaws_deg_.push_back(errors.yaw_deg);
    right_class_ += errors.right_class ? 1 : 0;
  }

  double Iou() const { return iou_sum_ / Count(); }
  std::string Found() const { return fmt::format("{} of {}", found_.Text(), total_); }
  std::string Extra() const { return extra_.Text(); }

  // Table cells for kErrorTitles, without the bars at either end.
  std::string ErrorCells() const {
    if (yaws_deg_.empty()) return "- | - | - | - | - | -";
    return fmt::format("{:.3f} | {:.3f} | {:.2f} | {:.2f} | {:.1f} | {:.0f} %", Iou(), lowest_iou_,
                       center_sum_cm_ / Count(), in_plane_sum_cm_ / Count(), Median(yaws_deg_),
                       100 * right_class_ / Count());
  }

 private:
  double Count() const { return std::max<double>(1, static_cast<double>(yaws_deg_.size())); }

  Range found_, extra_;
  size_t total_ = 0;
  double iou_sum_ = 0, center_sum_cm_ = 0, in_plane_sum_cm_ = 0, right_class_ = 0;
  double lowest_iou_ = 1;
  std::vector<double> yaws_deg_;
};

constexpr const char* kErrorTitles =
    "mean IoU | lowest IoU | center [cm] | in plane [cm] | yaw, median [deg] | right class";

Summary Summarize(std::span<const SequenceRuns> sequences, size_t row) {
  Summary summary;
  for (size_t i = 0; i < sequences.front().rows[row].runs.size(); ++i) {
    std::vector<const MapScore*> maps;
    for (const SequenceRuns& sequence : sequences) maps.push_back(&sequence.rows[row].runs[i].score);
    summary.Add(maps);
  }
  return summary;
}

std::string Line(int columns) {
  std::string line = "|";
  for (int i = 0; i < columns; ++i) line += " --- |";
  return line + "\n";
}

std::string Faults(const MapScore& score) {
  constexpr size_t kMaxNamed = 4;
  std::string faults;
  for (const TrueObject& object : score.objects) {
    if (!object.found) faults += fmt::format("; missing: {}", object.name);
  }
  size_t extra = 0;
  for (const MappedObject& mapped : score.mapped) {
    if (!mapped.matched.empty() || ++extra > kMaxNamed) continue;
    const std::string overlap = mapped.overlaps.empty() ? "" : ", overlaps " + mapped.overlaps;
    faults += fmt::format("; extra: {} ({}){}", mapped.object.id.ToString(), mapped.object.class_name, overlap);
  }
  if (extra > kMaxNamed) faults += fmt::format("; {} more extra", extra - kMaxNamed);
  return faults.empty() ? "" : faults.substr(2);
}

}  // namespace

std::string SequencesTable(std::span<const SequenceRuns> sequences) {
  std::string table =
      fmt::format("| sequence | frames tracked, worst | found | extra | {} |\n", kErrorTitles) + Line(10);
  for (const SequenceRuns& sequence : sequences) {
    const Summary summary = Summarize({&sequence, 1}, 0);
    double tracked_share = 1;
    for (const ScoredRun& run : sequence.rows.front().runs) tracked_share = std::min(tracked_share, run.tracked_share);
    table += fmt::format("| {} | {:.1f} % | {} | {} | {} |\n", sequence.sequence, 100 * tracked_share, summary.Found(),
                         summary.Extra(), summary.ErrorCells());
  }
  return table;
}

std::string DamageTable(std::span<const SequenceRuns> sequences) {
  std::string table = fmt::format("| masks | found | extra | IoU drop | {} |\n", kErrorTitles) + Line(10);
  const double undamaged = Summarize(sequences, 0).Iou();
  for (size_t row = 0; row < sequences.front().rows.size(); ++row) {
    const Summary summary = Summarize(sequences, row);
    table += fmt::format("| {} | {} | {} | {:.3f} | {} |\n", sequences.front().rows[row].damage, summary.Found(),
                         summary.Extra(), undamaged - summary.Iou(), summary.ErrorCells());
  }
  return table;
}

std::string ObjectsTable(const DamageRuns& row) {
  std::string table = fmt::format("| object | found | {} |\n", kErrorTitles) + Line(8);
  const std::vector<ScoredRun>& runs = row.runs;
  for (size_t j = 0; j < runs.front().score.objects.size(); ++j) {
    Summary summary;
    size_t found = 0;
    for (const ScoredRun& run : runs) {
      const TrueObject& object = run.score.objects[j];
      if (!object.found) continue;
      summary.AddErrors(object.errors);
      ++found;
    }
    table += fmt::format("| {} | {} of {} | {} |\n", runs.front().score.objects[j].name, found, runs.size(),
                         summary.ErrorCells());
  }
  return table;
}

std::string MapTable(const MapScore& score) {
  std::string table =
      "| object | class | score | frames | center [m] | true object | IoU | center error [cm] |\n" + Line(8);
  for (const MappedObject& mapped : score.mapped) {
    std::string truth = "no true object | - | -";
    if (!mapped.overlaps.empty()) truth = fmt::format("duplicate of {} | - | -", mapped.overlaps);
    for (const TrueObject& object : score.objects) {
      if (object.name != mapped.matched) continue;
      truth = fmt::format("{} | {:.3f} | {:.1f}", object.name, object.errors.iou, object.errors.center_cm);
    }
    const Eigen::Vector3d& center_m = mapped.center_m;
    table += fmt::format("| {} | {} | {:.2f} | {} | {:.2f} {:.2f} {:.2f} | {} |\n", mapped.object.id.ToString(),
                         mapped.object.class_name, mapped.object.class_score, mapped.object.observations, center_m.x(),
                         center_m.y(), center_m.z(), truth);
  }
  std::string missing;
  for (const TrueObject& object : score.objects) {
    if (!object.found) missing += (missing.empty() ? "" : ", ") + object.name;
  }
  return table + (missing.empty() ? "" : fmt::format("\nMissing: {}.\n", missing));
}

std::string FaultList(std::span<const SequenceRuns> sequences) {
  std::string list;
  for (const SequenceRuns& sequence : sequences) {
    for (const DamageRuns& row : sequence.rows) {
      for (const ScoredRun& run : row.runs) {
        const std::string faults = Faults(run.score);
        if (faults.empty()) continue;
        list += fmt::format("- {}, {}, seed {}: {}\n", sequence.sequence, row.damage, run.seed, faults);
      }
    }
  }
  return list;
}

}  // namespace romap::measure
