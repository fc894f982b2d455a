#pragma once

namespace romap {

// Version of this build, e.g. "0.1.0": the VERSION of project() in the top-level CMakeLists.txt.
const char* Version();

}  // namespace romap
