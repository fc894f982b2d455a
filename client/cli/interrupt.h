#pragma once

namespace romap::cli {

// From now on the first Ctrl-C (or SIGTERM) only sets a flag, so that a command can finish and write what there is; the
// second ends the process at once.
void CatchInterrupts();
bool Interrupted();

}  // namespace romap::cli
