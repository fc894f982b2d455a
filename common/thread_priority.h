#pragma once

namespace romap {

// Lets the calling thread yield to the others of the process: what answers a client comes first, training and meshing
// take what is left. Does nothing where the system has no priorities per thread.
void LowerThreadPriority();

}  // namespace romap
