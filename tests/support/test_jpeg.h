#pragma once

#include <string>

namespace romap::testing_support {

// Repeats the last scan of a progressive JPEG file, with its tables, `more` times.
std::string WithScans(const std::string& bytes, int more);

}  // namespace romap::testing_support
