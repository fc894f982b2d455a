#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "client/bench/methods.h"
#include "client/bench/paper_results.h"
#include "client/bench/true_views.h"

namespace romap::bench {

// The parameters of one run of a method.
struct MethodRun {
  BenchMethod method;
  EngineConfig config;
  int seed = 1;
  int subset = 0;
  std::vector<double> limits_s = {};  // limits of the training time, ascending; the last is the cap
  bool with_curve = false;
  std::string keep_dir = {};  // folder for the final meshes (in objects/); empty = not kept
};

struct MethodOutcome {
  std::vector<Evaluation> evaluations;  // one per limit
  std::vector<CurvePoint> curve;
};

// Trains all objects of a sequence with different methods and compares them with the ground truth. The views are
// created once and shared by all methods.
class MethodRunner {
 public:
  MethodRunner(const files::Sequence& sequence, std::string scratch_dir, int threads, BenchClock clock);

  // Sets the frames for the following runs.
  void SetFrames(TrueFrames frames);

  // Calls `report` with the name of each object. CANCELLED if `stop` returns true. Errors of writing meshes as
  // WriteFile.
  absl::StatusOr<MethodOutcome> Run(const MethodRun& run, const std::function<void(const std::string&)>& report,
                                    const std::function<bool()>& stop);

 private:
  struct Trained;

  const std::vector<ObjectView>& ViewsOf(const files::ObjectRecord& object, bool with_depth);
  absl::StatusOr<Trained> Train(const MethodRun& run, const files::ObjectRecord& object, double limit_s,
                                const std::function<bool()>& stop);
  absl::StatusOr<Evaluation> Evaluate(const MethodRun& run, const std::vector<Trained>& trained, double limit_s,
                                      const std::string& dir) const;
  absl::StatusOr<std::vector<CurvePoint>> Curve(const MethodRun& run, const std::vector<Trained>& trained) const;

  const files::Sequence* sequence_;
  std::string scratch_dir_;
  int threads_;
  BenchClock clock_;
  TrueFrames frames_;
  std::map<std::pair<int64_t, bool>, std::vector<ObjectView>> views_;
  std::map<std::string, double> seconds_per_step_;  // by method and object
};

}  // namespace romap::bench
