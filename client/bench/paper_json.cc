// The JSON report.
#include <nlohmann/json.hpp>

#include "client/bench/paper_results.h"

namespace romap::bench {
namespace {

using Json = nlohmann::ordered_json;

Json ToJson(const PublishedQuality& q) {
  return {{"accuracy_cm", q.accuracy_cm},
          {"completion_cm", q.completion_cm},
          {"below_04_percent", q.below_04_percent},
          {"below_1_percent", q.below_1_percent}};
}

Json LimitJson(double limit_s) { return limit_s == kToTheEnd_s ? Json(nullptr) : Json(limit_s); }

Json ToJson(const MethodMean& m) {
  return {{"evaluations", m.evaluations},
          {"mean", ToJson(m.quality)},
          {"deviation", ToJson(m.spread)},
          {"found_share", m.found_share},
          {"steps", m.steps},
          {"train_s", m.train_s},
          {"wall_s", m.wall_s},
          {"setup_s", m.setup_s},
          {"surface_ms", m.mesh_ms},
          {"iteration_ms", m.iteration_ms},
          {"sampling_ms", m.sampling_ms},
          {"forward_ms", m.forward_ms},
          {"backward_ms", m.backward_ms},
          {"samples_per_s", m.samples_per_s},
          {"plan_cut", m.limited}};
}

Json ToJson(const ObjectTraining& o) {
  Json json = {{"object", o.object},    {"views", o.views},     {"steps", o.steps},
               {"train_s", o.train_s},  {"wall_s", o.wall_s},   {"setup_s", o.setup_s},
               {"surface_s", o.mesh_s}, {"samples", o.samples}, {"plan_cut", o.limited}};
  if (!o.fault.empty()) json["fault"] = o.fault;
  return json;
}

Json ToJson(const Evaluation& e) {
  Json json = {{"method", e.method}, {"limit_s", LimitJson(e.limit_s)}, {"seed", e.seed}, {"subset", e.subset}};
  json["quality"] = e.quality ? ToJson(*e.quality) : Json(nullptr);
  json["matched"] = e.matched;
  if (!e.note.empty()) json["note"] = e.note;
  json["objects"] = Json::array();
  for (const ObjectTraining& o : e.objects) json["objects"].push_back(ToJson(o));
  return json;
}

Json ToJson(const PaperResults& r, const BenchTable& table) {
  Json json = {{"table", table.id}, {"rows", Json::array()}};
  std::vector<double> limits = r.times_s;
  limits.push_back(kToTheEnd_s);
  for (const BenchMethod& method : table.methods) {
    Json row = {{"id", method.id},
                {"title", method.title},
                {"settings", method.settings},
                {"with_depth", method.with_depth},
                {"results", Json::array()}};
    const auto published = PublishedTable1(method.id);
    row["paper_rtx4090"] = published ? ToJson(*published) : Json(nullptr);
    for (const double limit_s : limits) {
      const auto mean = MeanOf(r, method.id, limit_s);
      if (!mean) continue;
      Json result = ToJson(*mean);
      result["limit_s"] = LimitJson(limit_s);
      row["results"].push_back(std::move(result));
    }
    json["rows"].push_back(std::move(row));
  }
  return json;
}

}  // namespace

std::string ToJsonText(const PaperResults& r) {
  Json json = {{"sequence", r.sequence},
               {"objects", r.objects},
               {"frames_per_subset", r.frames_per_subset},
               {"threads", r.threads},
               {"clock", r.clock == BenchClock::kWall ? "wall" : "cpu"},
               {"cap_s", r.cap_s},
               {"times_s", r.times_s},
               {"runs", {{"planned", r.runs_planned}, {"done", r.runs_done}}},
               {"fma_peak_gflops", r.fma_peak_gflops},
               {"tables", Json::array()},
               {"curves", Json::array()},
               {"evaluations", Json::array()},
               {"notes", r.notes}};
  for (const BenchTable& table : r.tables) json["tables"].push_back(ToJson(r, table));
  for (const CurvePoint& p : r.curves) {
    json["curves"].push_back({{"method", p.method},
                              {"train_s", p.train_s},
                              {"accuracy_cm", p.accuracy_cm},
                              {"completion_cm", p.completion_cm}});
  }
  for (const Evaluation& e : r.evaluations) json["evaluations"].push_back(ToJson(e));
  return json.dump(1) + "\n";
}

}  // namespace romap::bench
