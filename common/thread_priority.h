#pragma once

namespace romap {

// Lowers the priority of the calling thread, by `nice` steps of the nice value, for training, meshing and
// adjustment, so that threads that serve clients run first. No
// effect on systems without priorities per thread.
void LowerThreadPriority(int nice = 10);

}  // namespace romap
