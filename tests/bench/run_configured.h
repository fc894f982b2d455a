#pragma once

#include <cstdio>

#include "common/config.h"
#include "common/status.h"

namespace romap::measure {

// Runs a bench of fields and meshes whose `options` hold their configuration in `nerf` and `mesh`, after the
// `assignments` of the command line. Returns the exit status; an error is one line on stderr.
template <class Options>
int RunConfigured(Options& options, absl::Status (*run)(const Options&)) {
  ConfigFields fields;
  fields.Section("nerf");
  options.nerf.Fields(fields);
  fields.Section("mesh");
  options.mesh.Fields(fields);
  absl::Status status = fields.Set(options.assignments);
  if (status.ok()) status = run(options);
  if (!status.ok()) std::fprintf(stderr, "error: %s\n", Message(status).c_str());
  return status.ok() ? 0 : 1;
}

}  // namespace romap::measure
