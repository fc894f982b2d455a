#pragma once

#include <string>

namespace romap {

// The text of `PROGRAM --version`: the version, and the commit if the program was built in a checkout. `verbose`: also
// the libraries that it was built against.
std::string BuildInfo(const std::string& program, bool verbose);

// Whether the command line has the word `--verbose`. For --version, which ends the parsing of the others.
bool HasVerboseFlag(int argc, const char* const* argv);

}  // namespace romap
