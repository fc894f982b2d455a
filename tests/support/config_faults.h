#pragma once

#include <string>
#include <vector>

#include "common/config.h"
#include "common/status.h"

namespace romap::testing_support {

// Returns the error message for a stage's settings after `assignments`; empty if they are valid.
template <class Config>
std::string FaultsOf(const std::string& section, const std::vector<std::string>& assignments) {
  Config config;
  ConfigFields fields;
  fields.Section(section);
  config.Fields(fields);
  return Message(fields.Load("", assignments));
}

}  // namespace romap::testing_support
