#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "client/eval/eval.h"

namespace romap {
namespace {

constexpr int kNumberWidth = 10;

// A number in ten columns, `-` where there is none.
std::string Cell(std::optional<double> value) {
  if (!value) return fmt::format("{:>{}}", "-", kNumberWidth);
  return fmt::format("{:>{}.{}f}", *value, kNumberWidth, std::abs(*value) < 100 ? 4 : 2);
}

std::string Cell(const std::string& text) { return fmt::format("{:>{}}", text, kNumberWidth); }

// Width of a column of names, with a blank behind the longest.
size_t NameWidth(const std::vector<std::string>& names) {
  size_t width = 0;
  for (const std::string& name : names) width = std::max(width, name.size());
  return width + 1;
}

template <class Figures>
std::string SurfaceCells(const Figures& figures) {
  std::string cells = Cell(figures.accuracy_cm) + Cell(figures.accuracy_seen_cm) + Cell(figures.completion_cm) +
                      Cell(figures.completion_seen_cm);
  for (const auto& ratio : figures.ratios) cells += Cell(ratio.all_percent) + Cell(ratio.seen_percent);
  return cells;
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
  if (report.options.alignment != Alignment::kNone) head += Cell("scale") + Cell("icp.rms");
  return head;
}

}  // namespace

std::string FormatTable(const ObjectsReport& report) {
  std::vector<std::string> names{"object"}, predicted{"predicted"};
  for (const ObjectRow& row : report.rows) {
    names.push_back(row.object);
    predicted.push_back(row.match ? row.match->predicted : "MISSING");
  }
  names.push_back("mean");
  predicted.push_back(fmt::format("{} of {}", report.matched, report.rows.size()));
  const size_t name_width = NameWidth(names), predicted_width = NameWidth(predicted);
  const auto line = [&](size_t k, const std::string& cells) {
    return fmt::format("{:<{}}{:<{}}{}\n", names[k], name_width, predicted[k], predicted_width, cells);
  };
  std::string table = fmt::format("meshes, distances in cm; per-object ICP: {}\n", ToString(report.options.alignment));
  if (!report.options.estimated_trajectory.empty()) {
    table += fmt::format("moved by the trajectories ({}), scale {:.6f}\n",
                         ToString(report.options.trajectory_alignment), report.trajectory_scale);
  }
  table += line(0, ObjectsHead(report));
  for (size_t k = 0; k < report.rows.size(); ++k) {
    const std::optional<ObjectMatch>& match = report.rows[k].match;
    table += line(k + 1, match ? SurfaceCells(match->figures) + IcpCells(match->icp) : "");
  }
  table += line(names.size() - 1, SurfaceCells(report.mean));
  if (!report.extra.empty()) {
    table += fmt::format("predicted without a true object: {}\n", fmt::join(report.extra, ", "));
  }
  if (report.matched == report.rows.size()) return table;
  table += "missing objects are left out of the mean; with 0 for them the ratios are:";
  for (const auto& ratio : report.mean.ratios) {
    table += fmt::format("  <{}cm {:.2f}", ratio.threshold_cm, ratio.all_percent_with_missing);
  }
  return table + "\n";
}

std::string FormatTable(const BoxesReport& report) {
  std::vector<std::string> names{"object"}, predicted{"predicted"};
  for (const BoxRow& row : report.rows) {
    names.push_back(row.object);
    predicted.push_back(row.match ? row.match->predicted : "MISSING");
  }
  names.push_back("mean");
  predicted.push_back(fmt::format("{} of {}", report.matched, report.rows.size()));
  const size_t name_width = NameWidth(names), predicted_width = NameWidth(predicted);
  const auto line = [&](size_t k, const std::string& cells) {
    return fmt::format("{:<{}}{:<{}}{}\n", names[k], name_width, predicted[k], predicted_width, cells);
  };
  std::string table =
      "cuboids\n" + line(0, Cell("IoU3D") + Cell("centre.cm") + Cell("yaw.deg") + Cell("tilt.deg") + "   size ratio");
  for (size_t k = 0; k < report.rows.size(); ++k) {
    const std::optional<BoxFigures>& match = report.rows[k].match;
    if (!match) {
      table += line(k + 1, Cell(0.0));
      continue;
    }
    table += line(k + 1, Cell(match->iou) + Cell(match->center_cm) + Cell(match->yaw_deg) + Cell(match->tilt_deg) +
                             fmt::format("   {:.3f}", fmt::join(match->size_ratio, " ")));
  }
  table += line(names.size() - 1, Cell(report.iou_matched) + Cell(report.center_cm) + Cell(report.yaw_deg));
  table += fmt::format("mean IoU with missing = 0: {:.4f}; predicted without a true object: {}\n", report.iou_all,
                       report.extra.empty() ? "none" : fmt::format("{}", fmt::join(report.extra, ", ")));
  return table;
}

std::string FormatTable(const TrajectoryReport& report) {
  return fmt::format(
      "trajectory, align {}: {} of {} poses matched (truth has {}), path {:.3f} m, scale {:.6f}\n"
      "ATE rmse {:.6f} m  mean {:.6f}  median {:.6f}  max {:.6f}\n"
      "rotation rmse {:.4f} deg  max {:.4f}\n",
      ToString(report.alignment), report.matched, report.estimated_poses, report.ground_truth_poses,
      report.path_length_m, report.scale, report.ate_rmse_m, report.ate_mean_m, report.ate_median_m, report.ate_max_m,
      report.rotation_rmse_deg, report.rotation_max_deg);
}

std::string FormatTable(const RunReport& report) {
  std::vector<std::string> parts;
  if (report.objects) parts.push_back(FormatTable(*report.objects));
  if (report.boxes) parts.push_back(FormatTable(*report.boxes));
  if (report.trajectory) parts.push_back(FormatTable(*report.trajectory));
  for (const std::string& note : report.notes) parts.push_back(note + "\n");
  return fmt::format("{}", fmt::join(parts, "\n"));
}

}  // namespace romap
