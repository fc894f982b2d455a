#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "server/nerf/nerf_config.h"

namespace romap::nerf::cuda {

// Times of the parts of a training on the device of this machine, in the rows of the paper's Table 3.
struct RuntimeTable {
  std::string field;  // name of the configuration
  int rays = 0;       // per iteration
  double samples = 0;
  double ray_upload_ms = 0;  // per iteration, like the next three
  double gradients_ms = 0;   // sampling, forward, rendering, backward: one kernel
  double optimize_ms = 0;    // optimizer and occupancy
  double iteration_ms = 0;   // a whole iteration of the training: graph, uploads, losses
  double evaluate_ms = 0;    // evaluation of the field at mesh_side^3 points, including colors
  double MillionSamplesPerSecond() const { return samples / iteration_ms * 1e-3; }
};

// Trains a field on rays at a ball for `steps` steps, after the same number of steps as warm-up, and evaluates it at
// mesh_side^3 points. Errors are those of ToStatus.
absl::StatusOr<RuntimeTable> MeasureRuntime(const NerfConfig& config, const std::string& name, int steps,
                                            int mesh_side = 64);

// The tables as Markdown, next to the values of the paper.
std::string Markdown(const std::string& device, const std::vector<RuntimeTable>& tables);

// Name of the device, empty if there is none.
std::string DeviceName();

}  // namespace romap::nerf::cuda
