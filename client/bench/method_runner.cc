#include "client/bench/method_runner.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "client/bench/hull_field.h"
#include "client/eval/eval.h"
#include "client/files/ply.h"
#include "client/files/text_file.h"
#include "server/mesh/extract_mesh.h"

namespace romap::bench {
namespace {

namespace fs = std::filesystem;

// The training times at which curves have points [s].
constexpr double kMarks_s[] = {0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1, 1.5, 2, 3.5, 5, 10, 20, 50, 100, 200, 500};

absl::Status WriteWorldMesh(const FieldSnapshot& snapshot, Mesh mesh, const std::string& path) {
  for (Eigen::Vector3f& v : mesh.vertices) v = (snapshot.T_world_object * v.cast<double>()).cast<float>();
  for (Eigen::Vector3f& n : mesh.normals) n = (snapshot.T_world_object.rotation() * n.cast<double>()).cast<float>();
  return files::WritePly(path, mesh);
}

std::optional<PublishedQuality> QualityOf(const eval::ObjectsReport& report) {
  const eval::ObjectsReport::Mean& mean = report.mean;
  if (!mean.accuracy_seen_cm || !mean.completion_seen_cm || mean.ratios.size() != 2) return std::nullopt;
  return PublishedQuality{*mean.accuracy_seen_cm, *mean.completion_seen_cm, mean.ratios[0].seen_percent.value_or(0),
                          mean.ratios[1].seen_percent.value_or(0)};
}

double Sum(const nerf::TrainStats& stats, std::initializer_list<nerf::TrainPhase> phases) {
  double sum = 0;
  for (const nerf::TrainPhase phase : phases) sum += stats.phase_cpu_s[static_cast<size_t>(phase)];
  return sum;
}

void FillIn(const TimedTraining& training, ObjectTraining& row) {
  const nerf::TrainStats& stats = training.stats;
  row.steps = stats.steps;
  row.samples = stats.samples;
  row.train_s = training.train_s;
  row.wall_s = training.wall_s;
  row.setup_s = training.setup_s;
  row.limited = training.limited;
  row.sampling_s = Sum(stats, {nerf::TrainPhase::kSampling});
  row.forward_s = Sum(stats, {nerf::TrainPhase::kEncode, nerf::TrainPhase::kMlp, nerf::TrainPhase::kRender});
  row.backward_s =
      Sum(stats, {nerf::TrainPhase::kMlpBackward, nerf::TrainPhase::kEncodeBackward, nerf::TrainPhase::kOptimize});
}

}  // namespace

struct MethodRunner::Trained {
  ObjectTraining row;
  const files::ObjectRecord* object = nullptr;
  FieldSnapshot snapshot;  // without a field if training failed
  std::vector<FieldSnapshot> at_marks;
};

MethodRunner::MethodRunner(const files::Sequence& sequence, std::string scratch_dir, int threads, BenchClock clock)
    : sequence_(&sequence), scratch_dir_(std::move(scratch_dir)), threads_(threads), clock_(clock) {}

void MethodRunner::SetFrames(TrueFrames frames) {
  frames_ = std::move(frames);
  views_.clear();
}

const std::vector<ObjectView>& MethodRunner::ViewsOf(const files::ObjectRecord& object, bool with_depth) {
  const auto [entry, is_new] = views_.try_emplace({object.id, with_depth});
  if (is_new) entry->second = MakeTrueViews(frames_, object, with_depth);
  return entry->second;
}

absl::StatusOr<MethodRunner::Trained> MethodRunner::Train(const MethodRun& run, const files::ObjectRecord& object,
                                                          double limit_s, const std::function<bool()>& stop) {
  const std::vector<ObjectView>& views = ViewsOf(object, run.method.with_depth);
  const Cuboid cuboid{object.T_world_object, object.half_extents, 1.0};
  Trained trained;
  trained.object = &object;
  trained.row.object = object.name;
  trained.row.views = static_cast<int>(views.size());
  if (!run.method.trained) {
    Stopwatch watch(clock_, /*threads=*/1);
    trained.snapshot = watch.Time([&] { return MakeHullSnapshot(run.config.nerf, cuboid, views); });
    trained.row.setup_s = watch.total_s();
    return trained;
  }
  TrainingRequest request{.config = run.config.nerf,
                          .cuboid = cuboid,
                          .views = &views,
                          .seed = static_cast<uint64_t>(run.seed),
                          .threads = threads_,
                          .clock = clock_,
                          .limit_s = limit_s,
                          .stop = stop};
  if (run.with_curve) request.marks_s.assign(std::begin(kMarks_s), std::end(kMarks_s));
  double& seconds_per_step = seconds_per_step_[run.method.id + "/" + object.name];
  absl::StatusOr<TimedTraining> training = TrainWithin(request, seconds_per_step);
  if (absl::IsCancelled(training.status())) return training.status();
  if (!training.ok()) {
    trained.row.fault = Message(training.status());
    return trained;
  }
  FillIn(*training, trained.row);
  trained.snapshot = std::move(training->snapshot);
  trained.at_marks = std::move(training->at_marks);
  return trained;
}

absl::StatusOr<Evaluation> MethodRunner::Evaluate(const MethodRun& run, const std::vector<Trained>& trained,
                                                  double limit_s, const std::string& dir) const {
  Evaluation evaluation{.method = run.method.id, .limit_s = limit_s, .seed = run.seed, .subset = run.subset};
  std::error_code error;
  fs::remove_all(dir + "/objects", error);
  ROMAP_RETURN_IF_ERROR(files::MakeFolder(dir + "/objects"));
  for (const Trained& one : trained) {
    ObjectTraining& row = evaluation.objects.emplace_back(one.row);
    if (!one.snapshot.field) continue;
    Stopwatch watch(clock_, /*threads=*/1);
    absl::StatusOr<Mesh> mesh = watch.Time([&] { return mesh::ExtractMesh(one.snapshot, run.config.mesh); });
    row.mesh_s = watch.total_s();
    if (!mesh.ok()) {
      row.fault = Message(mesh.status());
      continue;
    }
    const std::string path = fmt::format("{}/objects/{}_{}.ply", dir, one.object->id, one.object->name);
    ROMAP_RETURN_IF_ERROR(WriteWorldMesh(one.snapshot, *std::move(mesh), path));
  }
  const eval::RunReport report = eval::EvaluateRun(
      dir, sequence_->dir(), {.alignment = eval::Alignment::kNone, .reason = "training used the given camera poses"});
  if (report.objects) {
    evaluation.quality = QualityOf(*report.objects);
    evaluation.matched = report.objects->matched;
  } else {
    evaluation.note = fmt::format("{}", fmt::join(report.notes, "; "));
  }
  return evaluation;
}

absl::StatusOr<std::vector<CurvePoint>> MethodRunner::Curve(const MethodRun& run,
                                                            const std::vector<Trained>& trained) const {
  std::vector<CurvePoint> curve;
  for (size_t mark = 0; mark < std::size(kMarks_s); ++mark) {
    std::vector<Trained> at_mark = trained;
    bool any = false;
    double train_s = 0;
    for (Trained& one : at_mark) {  // objects that finished earlier keep their final state
      const bool reached = mark < one.at_marks.size();
      if (reached) one.snapshot = one.at_marks[mark];
      any |= reached;
      train_s += (reached ? kMarks_s[mark] : one.row.train_s) / static_cast<double>(at_mark.size());
    }
    if (!any) break;
    ROMAP_ASSIGN_OR_RETURN(const Evaluation point, Evaluate(run, at_mark, kMarks_s[mark], scratch_dir_));
    if (!point.quality) continue;
    curve.push_back({run.method.id, train_s, point.quality->accuracy_cm, point.quality->completion_cm});
  }
  return curve;
}

absl::StatusOr<MethodOutcome> MethodRunner::Run(const MethodRun& run,
                                                const std::function<void(const std::string&)>& report,
                                                const std::function<bool()>& stop) {
  MethodOutcome outcome;
  std::vector<Trained> trained;
  for (size_t limit = 0; limit < run.limits_s.size(); ++limit) {
    const bool last = limit + 1 == run.limits_s.size();
    bool changed = false;
    size_t index = 0;
    for (const files::ObjectRecord& object : sequence_->objects()->objects) {
      const size_t at = index++;
      if (at < trained.size() && !trained[at].row.limited)
        continue;  // its training plan completed within an earlier limit
      report(object.name);
      ROMAP_ASSIGN_OR_RETURN(Trained one, Train(run, object, run.limits_s[limit], stop));
      trained.resize(std::max(trained.size(), at + 1));
      trained[at] = std::move(one);
      changed = true;
    }
    const double label_s = last ? kToTheEnd_s : run.limits_s[limit];
    if (changed || (last && !run.keep_dir.empty())) {
      const std::string dir = last && !run.keep_dir.empty() ? run.keep_dir : scratch_dir_;
      ROMAP_ASSIGN_OR_RETURN(Evaluation evaluation, Evaluate(run, trained, label_s, dir));
      outcome.evaluations.push_back(std::move(evaluation));
    } else {
      outcome.evaluations.push_back(outcome.evaluations.back());
      outcome.evaluations.back().limit_s = label_s;
    }
  }
  if (!run.with_curve) return outcome;
  ROMAP_ASSIGN_OR_RETURN(outcome.curve, Curve(run, trained));
  const Evaluation& end = outcome.evaluations.back();
  if (end.quality) {
    double train_s = 0;
    for (const ObjectTraining& o : end.objects) train_s += o.train_s / static_cast<double>(end.objects.size());
    outcome.curve.push_back({run.method.id, train_s, end.quality->accuracy_cm, end.quality->completion_cm});
  }
  return outcome;
}

}  // namespace romap::bench
