#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "client/eval/eval.h"

namespace romap::eval {
namespace {

constexpr int kNumberWidth = 10;

// A number padded to the column width; `-` if absent.
std::string Cell(std::optional<double> value) {
  if (!value) return fmt::format("{:>{}}", "-", kNumberWidth);
  const double size = std::abs(*value);
  if (size > 0 && size < 1e-3) return fmt::format("{:>{}.2e}", *value, kNumberWidth);  // e.g. of a map in kilometers
  return fmt::format("{:>{}.{}f}", *value, kNumberWidth, size < 100 ? 4 : 2);
}

std::string Cell(const std::string& text) { return fmt::format("{:>{}}", text, kNumberWidth); }

// Rows of two names and preformatted cells, with aligned columns.
class Table {
 public:
  void Add(const std::string& object, const std::string& predicted, const std::string& cells) {
    rows_.push_back({object, predicted, cells});
  }

  std::string ToString() const {
    std::array<size_t, 2> width{};
    for (const auto& row : rows_) {
      for (size_t k = 0; k < width.size(); ++k) width[k] = std::max(width[k], row[k].size() + 1);
    }
    std::string text;
    for (const auto& row : rows_) {
      text += fmt::format("{:<{}}{:<{}}{}\n", row[0], width[0], row[1], width[1], row[2]);
    }
    return text;
  }

 private:
  std::vector<std::array<std::string, 3>> rows_;
};

std::string CountOf(size_t matched, size_t all) { return fmt::format("{} of {}", matched, all); }

template <class Figures>
std::string SurfaceCells(const Figures& figures) {
  std::string cells = Cell(figures.accuracy_cm) + Cell(figures.accuracy_seen_cm) + Cell(figures.completion_cm) +
                      Cell(figures.completion_seen_cm);
  for (const auto& ratio : figures.ratios) cells += Cell(ratio.all_percent) + Cell(ratio.seen_percent);
  return cells;
}

// `shape`: ShapeFigures, or the means of them.
template <class Shape>
std::string ShapeCells(const Shape& shape) {
  return Cell(shape.accuracy_closed_cm) + Cell(shape.hollow_percent) + Cell(shape.normal_error_deg);
}

std::string IcpCells(const std::optional<IcpFigures>& icp) {
  if (!icp) return "";
  if (icp->failed) return Cell("failed") + Cell("-");
  return Cell(icp->scale) + Cell(icp->rms_cm);
}

std::string ObjectsHead(const ObjectsReport& report) {
  std::string head = Cell("acc") + Cell("acc.seen") + Cell("comp") + Cell("comp.seen");
  for (const double threshold_cm : report.options.thresholds_cm) {
    head += Cell(fmt::format("<{}cm%", threshold_cm)) + Cell("seen");
  }
  head += Cell("closed") + Cell("hollow%") + Cell("normal");
  if (report.options.alignment != Alignment::kNone) head += Cell("scale") + Cell("icp.rms");
  return head;
}

}  // namespace

std::string FormatTable(const ObjectsReport& report) {
  std::string text = fmt::format("meshes, distances in cm; per-object ICP: {}\n", ToString(report.options.alignment));
  if (!report.options.estimated_trajectory.empty()) {
    text += fmt::format("transformed by the alignment of the trajectories ({}), scale {:.6f}\n",
                        ToString(report.options.trajectory_alignment), report.trajectory_scale);
  }
  Table table;
  table.Add("object", "predicted", ObjectsHead(report));
  for (const ObjectRow& row : report.rows) {
    if (row.match) {
      table.Add(row.object, row.match->predicted,
                SurfaceCells(row.match->figures) + ShapeCells(row.match->figures.shape) + IcpCells(row.match->icp));
    } else {
      table.Add(row.object, "MISSING", "");
    }
  }
  table.Add("mean", CountOf(report.matched, report.rows.size()), SurfaceCells(report.mean) + ShapeCells(report.mean));
  text += table.ToString();
  if (!report.extra.empty()) {
    text += fmt::format("predicted meshes without a true object: {}\n", fmt::join(report.extra, ", "));
  }
  if (report.matched == report.rows.size()) return text;
  text += "the mean excludes missing objects; counting them as 0, the ratios are:";
  for (const auto& ratio : report.mean.ratios) {
    text += fmt::format("  <{}cm {:.2f}", ratio.threshold_cm, ratio.all_percent_with_missing);
  }
  return text + "\n";
}

std::string FormatTable(const BoxesReport& report) {
  Table table;
  table.Add("object", "predicted",
            Cell("IoU3D") + Cell("center.cm") + Cell("yaw.deg") + Cell("tilt.deg") + "   size ratio");
  for (const BoxRow& row : report.rows) {
    if (!row.match) {
      table.Add(row.object, "MISSING", Cell(0.0));
      continue;
    }
    const BoxFigures& match = *row.match;
    table.Add(row.object, match.predicted,
              Cell(match.iou) + Cell(match.center_cm) + Cell(match.yaw_deg) + Cell(match.tilt_deg) +
                  fmt::format("   {:.3f}", fmt::join(match.size_ratio, " ")));
  }
  table.Add("mean", CountOf(report.matched, report.rows.size()),
            Cell(report.iou_matched) + Cell(report.center_cm) + Cell(report.yaw_deg));
  return fmt::format(
      "cuboids\n{}mean IoU, missing objects counted as 0: {:.4f}; predicted cuboids without a true object: {}\n",
      table.ToString(), report.iou_all,
      report.extra.empty() ? "none" : fmt::format("{}", fmt::join(report.extra, ", ")));
}

std::string FormatTable(const RunReport& report) {
  std::vector<std::string> parts;
  parts.push_back(fmt::format("alignment with the ground truth: {} ({})\n", ToString(report.alignment.alignment),
                              report.alignment.reason));
  if (report.objects) parts.push_back(FormatTable(*report.objects));
  if (report.boxes) parts.push_back(FormatTable(*report.boxes));
  for (const std::string& note : report.notes) parts.push_back(note + "\n");
  if (const std::string trajectory = FormatTrajectory(report); !trajectory.empty()) parts.push_back(trajectory);
  return fmt::format("{}", fmt::join(parts, "\n"));
}

}  // namespace romap::eval
