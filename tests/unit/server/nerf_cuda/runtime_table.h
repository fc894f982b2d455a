#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "server/nerf/nerf_config.h"

namespace romap::nerf::cuda {

// How long the parts of a training take on the device that there is, as the paper's Table 3 has them.
struct RuntimeTable {
  std::string field;  // which configuration
  int rays = 0;       // per iteration
  double samples = 0;
  double ray_upload_ms = 0;  // per iteration, like the next three
  double gradients_ms = 0;   // sampling, forward, rendering, backward: one kernel
  double optimise_ms = 0;    // optimiser and occupancy
  double iteration_ms = 0;   // all of an iteration as training does it: graph, uploads, losses
  double evaluate_ms = 0;    // the field at mesh_side^3 points, colours included
  double MillionSamplesPerSecond() const { return samples / iteration_ms * 1e-3; }
};

// Trains a field on rays at a ball for `steps` steps after as many to warm up, and asks it at mesh_side^3 points.
// Errors are CUDA's.
absl::StatusOr<RuntimeTable> MeasureRuntime(const NerfConfig& config, const std::string& name, int steps,
                                            int mesh_side = 64);

// As Markdown, beside the paper's figures.
std::string Markdown(const std::string& device, const std::vector<RuntimeTable>& tables);

// "" without one.
std::string DeviceName();

}  // namespace romap::nerf::cuda
