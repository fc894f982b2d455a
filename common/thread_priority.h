#pragma once

namespace romap {

// Lowers the priority of the calling thread, for training and meshing, so that threads that serve clients run first. No
// effect on systems without priorities per thread.
void LowerThreadPriority();

}  // namespace romap
