// Measures the object map: runs tracking, sparse map and objects over sequences with ground truth, with several seeds
// (of labels, tracking and damage) and with masks that have the errors of real detectors, and prints Markdown tables.
//
//   object_quality SEQUENCE... [--poses given|none|both] [--seeds N] [--damage NAME|usual|rare|all]... [--objects]
//                  [--list] [--draw DIR] [--set SECTION.FIELD=VALUE]... [--masks FILE --detections FILE] [--jobs N]
//                  [--debug]
//
// --damage selects rows in addition to the one with undamaged masks. --poses none tracks the camera from the images;
// trajectory and cuboids are then transformed to the true world by the similarity that fits the trajectories best.
// Equal options print equal tables with any number of jobs.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <map>
#include <opencv2/core/utility.hpp>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/map_pictures.h"
#include "client/eval/alignment.h"
#include "client/files/sequence.h"
#include "common/config.h"
#include "tests/bench/object_run.h"
#include "tests/bench/object_score.h"
#include "tests/bench/object_tables.h"

namespace romap::measure {
namespace {

struct DamageKind {
  std::string name;   // for --damage
  std::string title;  // in tables
  MaskDamage damage;
  bool rare = false;  // in the second table
};

std::vector<DamageKind> DamageKinds() {
  return {
      {"none", "undamaged", {}},
      {"drop", "30 % of the masks missing", {.drop_share = 0.3}},
      {"rate", "only on 5 frames per second", {.rate_hz = 5}},
      {"border", "borders displaced by up to 4 px", {.border_px = 4}},
      {"flips", "10 % of the classes wrong", {.class_flip_share = 0.1}},
      {"merged", "neighbors merged in 5 % of the frames", {.merge_share = 0.05}},
      {"late", "half a second late", {.late_s = 0.5}},
      {"together",
       "all of these together",
       {.rate_hz = 5, .late_s = 0.5, .drop_share = 0.3, .border_px = 4, .merge_share = 0.05, .class_flip_share = 0.1}},
      {"flicker", "missing 30 % of the time, for 10 frames in a row", {.flicker_share = 0.3}, true},
      {"split", "10 % split in two", {.split_share = 0.1}, true},
      {"leak", "20 % extend beyond their object", {.leak_share = 0.2}, true},
      {"false", "a false detection in 30 % of the frames", {.false_positive_share = 0.3}, true},
      {"empty", "nothing found in 20 % of the frames", {.empty_share = 0.2}, true},
      {"crowd", "200 instances in every frame", {.crowd = 200}, true}};
}

struct Options {
  std::vector<std::string> sequences;
  std::string poses = "given";
  int seeds = 5;
  std::vector<std::string> damages;
  bool objects = false;
  bool list = false;
  std::string draw;
  std::vector<std::string> assignments;
  files::SequenceOptions files;
  int jobs = 1;
};

// One of several independent runs.
struct Job {
  const files::Sequence* sequence = nullptr;
  ObjectRunOptions options;
  std::string picture_dir;  // empty = no images
  ScoredRun* result = nullptr;
  absl::Status status = absl::OkStatus();
};

absl::StatusOr<Sim3<World, World>> AlignToTruth(const files::Sequence& sequence, const ObjectRun& run) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::StampedPose> truth,
                         files::ReadTum(sequence.dir() + "/groundtruth.txt"));
  ROMAP_ASSIGN_OR_RETURN(const eval::TrajectoryFit fit,
                         eval::AlignTrajectories(run.trajectory, truth, eval::Alignment::kSim3, /*max_dt_s=*/0.02));
  return fit.S_gt_est;
}

absl::Status Execute(const Job& job) {
  ROMAP_ASSIGN_OR_RETURN(const ObjectRun run, RunObjects(*job.sequence, job.options));
  job.result->tracked_share = static_cast<double>(run.trajectory.size()) / run.frames;
  const files::ObjectsYaml& truth = *job.sequence->objects();
  const std::vector<ObjectUpdate> objects = run.Confirmed();
  if (!job.picture_dir.empty()) {
    ROMAP_RETURN_IF_ERROR(cli::WriteCuboidPictures(job.picture_dir, *job.sequence, run.trajectory, objects));
  }
  absl::StatusOr<Sim3<World, World>> S_true_map = Sim3<World, World>();
  if (job.options.poses == PoseUse::kIgnore) S_true_map = AlignToTruth(*job.sequence, run);
  if (!S_true_map.ok()) {
    // Without a tracked camera, no object is found.
    job.result->score = ScoreMap(truth, {}, {});
    return absl::OkStatus();
  }
  job.result->score = ScoreMap(truth, objects, *S_true_map);
  return absl::OkStatus();
}

void ExecuteAll(std::vector<Job>& jobs, int threads) {
  std::atomic<size_t> next = 0, done = 0;
  const auto work = [&] {
    for (size_t i = next++; i < jobs.size(); i = next++) {
      jobs[i].status = Execute(jobs[i]);
      fmt::print(stderr, "\rrun {} of {} ", ++done, jobs.size());
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(work);
  work();
  for (std::thread& thread : others) thread.join();
  fmt::print(stderr, "\r");
}

class Measurement {
 public:
  Measurement(const Options& options, ObjectRunOptions base) : options_(options), base_(std::move(base)) {
    for (const DamageKind& kind : DamageKinds()) {
      const auto is_selected = [&](const std::string& name) {
        return std::find(options.damages.begin(), options.damages.end(), name) != options.damages.end();
      };
      if (kind.name == "none" || is_selected("all") || is_selected(kind.rare ? "rare" : "usual") ||
          is_selected(kind.name)) {
        kinds_.push_back(kind);
      }
    }
  }

  absl::Status Open() {
    for (const std::string& dir : options_.sequences) {
      ROMAP_ASSIGN_OR_RETURN(files::Sequence sequence, files::Sequence::Open(dir, options_.files));
      if (!sequence.objects())
        return NotFound("{}/objects.yaml does not exist; the sequence needs ground truth for its objects", dir);
      sequences_.push_back(std::move(sequence));
    }
    return absl::OkStatus();
  }

  absl::Status Measure(PoseUse poses) {
    std::vector<SequenceRuns> results;
    for (const files::Sequence& sequence : sequences_) {
      // The name of the folder, also if the path ends with a slash.
      SequenceRuns runs{(std::filesystem::path(sequence.dir()) / ".").parent_path().filename().string(), {}};
      for (const DamageKind& kind : kinds_) {
        runs.rows.push_back({kind.title, std::vector<ScoredRun>(static_cast<size_t>(options_.seeds))});
      }
      results.push_back(std::move(runs));
    }
    std::vector<Job> jobs = Jobs(poses, results);
    ExecuteAll(jobs, options_.jobs);
    for (const Job& job : jobs) ROMAP_RETURN_IF_ERROR(job.status);
    Print(poses, results);
    return absl::OkStatus();
  }

 private:
  std::vector<Job> Jobs(PoseUse poses, std::vector<SequenceRuns>& results) const {
    std::vector<Job> jobs;
    for (size_t s = 0; s < sequences_.size(); ++s) {
      for (size_t k = 0; k < kinds_.size(); ++k) {
        for (int seed = 1; seed <= options_.seeds; ++seed) {
          Job job{&sequences_[s], base_, "", &results[s].rows[k].runs[static_cast<size_t>(seed - 1)]};
          job.result->seed = seed;
          job.options.poses = poses;
          job.options.slam.seed = seed;
          job.options.damage = kinds_[k].damage;
          job.options.damage.permute_labels = true;
          job.options.damage.seed = static_cast<uint64_t>(seed);
          if (!options_.draw.empty() && seed == 1) {
            job.picture_dir = fmt::format("{}/{}_{}_{}", options_.draw, results[s].sequence, kinds_[k].name,
                                          poses == PoseUse::kGiven ? "given" : "tracked");
          }
          jobs.push_back(job);
        }
      }
    }
    return jobs;
  }

  void Print(PoseUse poses, const std::vector<SequenceRuns>& results) const {
    fmt::print("## Camera poses {}, {} seeds\n\n{}\n", poses == PoseUse::kGiven ? "given" : "from the images",
               options_.seeds, SequencesTable(results));
    for (const SequenceRuns& sequence : results) {
      for (const DamageRuns& row : sequence.rows) {
        if (options_.objects) fmt::print("{}, masks {}:\n\n{}\n", sequence.sequence, row.damage, ObjectsTable(row));
      }
      if (!options_.list) continue;
      fmt::print("{}, the map of the first seed:\n\n{}\n", sequence.sequence,
                 MapTable(sequence.rows.front().runs.front().score));
    }
    if (kinds_.size() > 1) {
      PrintDamage(results, /*rare=*/false, "Damaged masks");
      PrintDamage(results, /*rare=*/true, "Damaged masks, continued");
    }
    if (const std::string faults = FaultList(results); !faults.empty())
      fmt::print("Missing and extra objects:\n\n{}\n", faults);
    std::fflush(stdout);
  }

  // The rows of one table, the undamaged masks first.
  void PrintDamage(std::vector<SequenceRuns> results, bool rare, const char* title) const {
    bool any = false;
    for (SequenceRuns& sequence : results) {
      std::vector<DamageRuns> rows;
      for (size_t k = 0; k < kinds_.size(); ++k) {
        if (k > 0 && kinds_[k].rare != rare) continue;
        any |= k > 0;
        rows.push_back(sequence.rows[k]);
      }
      sequence.rows = rows;
    }
    if (any) fmt::print("{}:\n\n{}\n", title, DamageTable(results));
  }

  Options options_;
  ObjectRunOptions base_;
  std::vector<DamageKind> kinds_;
  std::vector<files::Sequence> sequences_;
};

absl::Status MeasureAll(const Options& options) {
  ObjectRunOptions base;
  ConfigFields fields;
  fields.Section("slam");
  base.slam.Fields(fields);
  fields.Section("objects");
  base.objects.Fields(fields);
  ROMAP_RETURN_IF_ERROR(fields.Load("", options.assignments));
  Measurement measurement(options, base);
  ROMAP_RETURN_IF_ERROR(measurement.Open());
  if (options.poses != "none") ROMAP_RETURN_IF_ERROR(measurement.Measure(PoseUse::kGiven));
  if (options.poses != "given") ROMAP_RETURN_IF_ERROR(measurement.Measure(PoseUse::kIgnore));
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  Options options;
  CLI::App app("Measures the object map against ground truth");
  app.add_option("sequences", options.sequences, "Folders of sequences")->required();
  app.add_option("--poses", options.poses, "Camera poses: given, none (tracked from the images) or both")
      ->check(CLI::IsMember({"given", "none", "both"}));
  app.add_option("--seeds", options.seeds, "Number of runs, with seeds 1, 2, ..")->check(CLI::PositiveNumber);
  std::vector<std::string> names = {"all", "usual", "rare"};
  for (const DamageKind& kind : DamageKinds()) names.push_back(kind.name);
  app.add_option("--damage", options.damages, "Kinds of mask damage in addition to none")->check(CLI::IsMember(names));
  bool debug = false;
  app.add_flag("--debug", debug, "Log the association of every mask");
  app.add_flag("--objects", options.objects, "Also print the errors of each object");
  app.add_flag("--list", options.list, "Also print the map of the first seed");
  app.add_option("--draw", options.draw, "Folder for images with the cuboids of the first seed");
  app.add_option("--set", options.assignments, "Configuration of slam or objects: SECTION.FIELD=VALUE");
  app.add_option("--masks", options.files.masks, "List of mask images of each sequence");
  app.add_option("--detections", options.files.detections, "File with the classes of the labels of each frame");
  app.add_option("--jobs", options.jobs, "Number of parallel runs")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  spdlog::set_level(debug ? spdlog::level::debug : spdlog::level::warn);
  cv::setNumThreads(1);
  if (const absl::Status status = MeasureAll(options); !status.ok()) {
    fmt::print(stderr, "object_quality: {}\n", Message(status));
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) { return romap::measure::Main(argc, argv); }
