#pragma once

#include <cstdio>

#include "common/config.h"
#include "common/status.h"

namespace romap::measure {

// Applies the `assignments` of the command line to the configurations `nerf` and `mesh` in `options`, then runs the
// benchmark. Returns the exit status; errors are printed on stderr.
template <class Options>
int RunConfigured(Options& options, absl::Status (*run)(const Options&)) {
  ConfigFields fields;
  fields.Section("nerf");
  options.nerf.Fields(fields);
  fields.Section("mesh");
  options.mesh.Fields(fields);
  absl::Status status = fields.Load("", options.assignments);
  if (status.ok()) status = run(options);
  if (!status.ok()) std::fprintf(stderr, "error: %s\n", Message(status).c_str());
  return status.ok() ? 0 : 1;
}

}  // namespace romap::measure
