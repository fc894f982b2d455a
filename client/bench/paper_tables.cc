// The Markdown report.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "client/bench/paper_results.h"

namespace romap::bench {
namespace {

constexpr const char* kNothing = "-";

std::string Head(const std::vector<std::string>& cells) {
  std::string line;
  for (size_t i = 0; i < cells.size(); ++i) line += " --- |";
  return fmt::format("| {} |\n|{}\n", fmt::join(cells, " | "), line);
}

std::string Row(const std::vector<std::string>& cells) { return fmt::format("| {} |\n", fmt::join(cells, " | ")); }

std::string QualityText(const PublishedQuality& q) {
  return fmt::format("{:.3f} / {:.3f} / {:.2f} / {:.2f}", q.accuracy_cm, q.completion_cm, q.below_04_percent,
                     q.below_1_percent);
}

std::string PaperText(const std::string& method) {
  const auto published = PublishedTable1(method);
  return published ? QualityText(*published) : kNothing;
}

std::string ClockText(const PaperResults& r) {
  return r.clock == BenchClock::kWall ? "wall time" : fmt::format("CPU time of {} threads / {}", r.threads, r.threads);
}

// The cells of one row of QualityTable().
std::vector<std::string> QualityCells(const PaperResults& r, const std::string& title, const MethodMean& m,
                                      const std::string& paper) {
  return {title,
          fmt::format("{:.3f} ± {:.3f}", m.quality.accuracy_cm, m.spread.accuracy_cm),
          fmt::format("{:.3f} ± {:.3f}", m.quality.completion_cm, m.spread.completion_cm),
          fmt::format("{:.2f}", m.quality.below_04_percent),
          fmt::format("{:.2f}", m.quality.below_1_percent),
          fmt::format("{:.0f} %", 100 * m.found_share),
          fmt::format("{:.0f}{}", m.steps, m.limited ? " (shortened)" : ""),
          fmt::format("{:.2f}", m.train_s),
          fmt::format("{:.2f}", m.wall_s),
          fmt::format("{:.3f}", 1e-3 * m.train_s * FmaPeak(r)),
          paper};
}

std::vector<std::string> QualityHead(const std::string& what) {
  return {what,    "accuracy [cm]", "completion [cm]", "< 0.4 cm [%]", "< 1 cm [%]",      "found",
          "steps", "training [s]",  "wall [s]",        "peak [TFLOP]", "paper (RTX 4090)"};
}

std::string QualityTable(const PaperResults& r, const BenchTable& table, double limit_s) {
  std::string text = Head(QualityHead(table.id == "1" ? "method" : "change"));
  bool any = false;
  for (const BenchMethod& method : table.methods) {
    const auto mean = MeanOf(r, method.id, limit_s);
    if (!mean) continue;
    any = true;
    text += Row(QualityCells(r, method.title, *mean, PaperText(method.id)));
  }
  if (!any) return "No measurements.\n";
  if (table.id == "1" && limit_s == kToTheEnd_s) {
    std::vector<std::string> colmap(QualityHead("").size(), kNothing);
    colmap.front() = "COLMAP";
    colmap.back() = PaperText("colmap");
    text += Row(colmap);
  }
  return text;
}

const BenchTable* Find(const PaperResults& r, const std::string& id) {
  for (const BenchTable& table : r.tables) {
    if (table.id == id) return &table;
  }
  return nullptr;
}

std::string Table1(const PaperResults& r) {
  const BenchTable* table = Find(r, "1");
  if (table == nullptr) return "";
  std::string text = "## Table 1: reconstruction of the objects\n";
  for (const double limit_s : r.times_s) {
    text += fmt::format("\n### After at most {:g} s of training per object\n\n{}", limit_s,
                        QualityTable(r, *table, limit_s));
  }
  text += fmt::format("\n### At the end of the training plan, or after {:g} s\n\n{}", r.cap_s,
                      QualityTable(r, *table, kToTheEnd_s));
  return text;
}

std::string Table3(const PaperResults& r) {
  std::vector<std::pair<std::string, MethodMean>> columns;
  for (const auto& [id, title] :
       {std::pair("fast", "fast [ms]"), {"sdf", "sdf [ms]"}, {"paper", "paper's configuration [ms]"}}) {
    if (const auto mean = MeanOf(r, id, kToTheEnd_s)) columns.emplace_back(title, *mean);
  }
  if (columns.empty()) return "";
  std::vector<std::string> head = {"part"};
  for (const auto& [title, mean] : columns) head.push_back(title);
  head.push_back("paper (RTX 4090) [ms]");
  std::string text = fmt::format(
      "\n## Table 3: time of one step of one object\n\nMeasured by {}. Without the object SLAM of the paper's table, "
      "because "
      "poses and masks are given.\n\n{}",
      ClockText(r), Head(head));
  const auto add = [&](const std::string& part, double MethodMean::*figure, double published) {
    std::vector<std::string> cells = {part};
    for (const auto& [title, mean] : columns) cells.push_back(fmt::format("{:.3f}", mean.*figure));
    cells.push_back(fmt::format("{:.4g}", published));
    text += Row(cells);
  };
  add("ray sampling", &MethodMean::sampling_ms, kPublishedSampling_ms);
  add("forward and volume rendering", &MethodMean::forward_ms, kPublishedForward_ms);
  add("backward and optimization", &MethodMean::backward_ms, kPublishedBackward_ms);
  add("iteration", &MethodMean::iteration_ms, kPublishedIteration_ms);
  add("surface (in the paper 64^3 nodes)", &MethodMean::mesh_ms, kPublishedMarchingCubes_ms);
  std::vector<std::string> rate = {"training samples per second"};
  for (const auto& [title, mean] : columns) rate.push_back(fmt::format("{:.2f} M", 1e-6 * mean.samples_per_s));
  rate.push_back(kNothing);
  return text + Row(rate);
}

std::string Table4(const PaperResults& r) {
  const BenchTable* table = Find(r, "4");
  if (table == nullptr) return "";
  std::string text = "\n## Table 4: model sizes\n\nEverything else is as in the fast preset.\n\n" +
                     Head({"model", "accuracy [cm]", "completion [cm]", "iteration [ms]", "steps",
                           "paper (RTX 4090): accuracy / completion / iteration"});
  for (size_t i = 0; i < table->methods.size(); ++i) {
    const auto mean = MeanOf(r, table->methods[i].id, kToTheEnd_s);
    if (!mean) continue;
    std::string paper = kNothing;
    for (const PublishedModelSize& p : kPublishedTable4) {
      if (table->methods[i].id == fmt::format("size-{}-{}", p.log2_table_entries, p.hidden_layers)) {
        paper = fmt::format("{:.3f} / {:.3f} / {:.3f}", p.accuracy_cm, p.completion_cm, p.iteration_ms);
      }
    }
    text += Row({table->methods[i].title,
                 fmt::format("{:.3f} ± {:.3f}", mean->quality.accuracy_cm, mean->spread.accuracy_cm),
                 fmt::format("{:.3f} ± {:.3f}", mean->quality.completion_cm, mean->spread.completion_cm),
                 fmt::format("{:.3f}", mean->iteration_ms),
                 fmt::format("{:.0f}{}", mean->steps, mean->limited ? " (shortened)" : ""), paper});
  }
  return text;
}

std::string Ablation(const PaperResults& r) {
  const BenchTable* table = Find(r, "ablation");
  if (table == nullptr) return "";
  return "\n## Ablation\n\nThe fast preset with one change at a time.\n\n" + QualityTable(r, *table, kToTheEnd_s);
}

std::string Curves(const PaperResults& r) {
  if (r.curves.empty()) return "";
  std::string text =
      "\n## Fig. 8: convergence\n\n![accuracy and completion over training time](convergence.png)\n\nFirst seed, first "
      "subset; means over the objects.\n\n" +
      Head({"method", "training [s]", "accuracy [cm]", "completion [cm]"});
  for (const CurvePoint& p : r.curves) {
    text += Row({p.method, fmt::format("{:.3g}", p.train_s), fmt::format("{:.3f}", p.accuracy_cm),
                 fmt::format("{:.3f}", p.completion_cm)});
  }
  return text;
}

std::string Settings(const PaperResults& r) {
  std::string text = "\n## Settings\n\n" + Head({"row", "settings that differ from the defaults"});
  for (const BenchTable& table : r.tables) {
    for (const BenchMethod& method : table.methods) {
      std::string settings = fmt::format("{}", fmt::join(method.settings, " "));
      if (method.with_depth) settings += " (with depth images)";
      if (!method.trained) settings += " (no training)";
      text += Row({method.title, settings.empty() ? kNothing : settings});
    }
  }
  return text;
}

}  // namespace

std::string ToMarkdown(const PaperResults& r) {
  std::string text = fmt::format(
      "# romap compared with the tables of the paper\n\n{}: {} objects, {} frames per subset; means over {} of {} runs "
      "(seeds x subsets) ± standard deviation. Poses, masks and cuboids are ground truth. The figures are the means "
      "of `romap eval` over the surface that was visible to at least one camera.\n\nTraining time is per object, "
      "measured by {}. \"peak\" is "
      "this time multiplied by the peak multiply-add rate of the machine, {:.0f} GFLOP/s on {} threads, measured "
      "between the runs; it is comparable between machines. The figures of the paper were measured on an RTX 4090, "
      "with poses "
      "from its SLAM and meshes aligned with the truth by ICP: accuracy / completion / < 0.4 cm / < 1 cm.\n\n",
      r.sequence, r.objects, r.frames_per_subset, r.runs_done, r.runs_planned, ClockText(r), FmaPeak(r), r.threads);
  text += Table1(r) + Table3(r) + Table4(r) + Ablation(r) + Curves(r) + Settings(r);
  if (!r.notes.empty()) {
    text += "\n## Notes\n\n";
    for (const std::string& note : r.notes) text += fmt::format("- {}\n", note);
  }
  return text;
}

}  // namespace romap::bench
