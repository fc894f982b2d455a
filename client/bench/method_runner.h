#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "client/bench/methods.h"
#include "client/bench/paper_results.h"
#include "client/bench/true_views.h"

namespace romap::bench {

// What one method is run with.
struct MethodRun {
  BenchMethod method;
  EngineConfig config;
  int seed = 1;
  int subset = 0;
  std::vector<double> limits_s = {};  // of training; ascending, the last is the cap and stands for the end
  bool with_curve = false;
  std::string keep_dir = {};  // for the meshes of the end, in objects/; empty = they are not kept
};

struct MethodOutcome {
  std::vector<Evaluation> evaluations;  // one per limit
  std::vector<CurvePoint> curve;
};

// Trains all objects of a sequence by one method after the other and holds them against the truth. Views are made once
// and shared by all methods.
class MethodRunner {
 public:
  MethodRunner(const files::Sequence& sequence, std::string scratch_dir, int threads, BenchClock clock);

  // From now on on these frames.
  void SetFrames(TrueFrames frames);

  // `report` is called with each object's name. CANCELLED: `stop` said so. INTERNAL and such: a mesh cannot be written.
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
