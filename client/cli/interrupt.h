#pragma once

namespace romap::cli {

// Installs a handler for SIGINT and SIGTERM. The first signal sets the flag that Interrupted() returns, so that a
// command can stop early and write its results; the second signal terminates the process.
void CatchInterrupts();
bool Interrupted();

}  // namespace romap::cli
