#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tests/support/sanitizer.h"

namespace romap::integration {

// Whether runs train long enough for good shapes; otherwise tests must not judge the shapes.
inline constexpr bool kShapesAreGood = !testing_support::kUnderSanitizer;

// Appends settings to a command that maps: they reduce the training and the resolution of the meshes, and omit
// textures.
inline std::vector<std::string> WithLittleTraining(std::vector<std::string> command) {
  for (const char* setting : {"nerf.first_budget_steps=40", "nerf.full_budget_steps=40", "nerf.refine_steps_per_view=1",
                              "mesh.resolution=32", "mesh.min_side_nodes=32", "mesh.texture=false"}) {
    command.insert(command.end(), {"--set", setting});
  }
  return command;
}

// Appends these settings under a sanitizer only.
inline std::vector<std::string> Quick(std::vector<std::string> command) {
  return kShapesAreGood ? command : WithLittleTraining(std::move(command));
}

}  // namespace romap::integration
