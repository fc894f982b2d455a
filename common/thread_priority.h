#pragma once

namespace romap {

// Steps of the nice value below the threads that track and map, the most urgent first. Beside a busy thread without
// such a step, a thread at 5 gets a quarter of a core, one at 10 a tenth.
inline constexpr int kLocalAdjustmentNice = 5;
inline constexpr int kGlobalAdjustmentNice = 10;
inline constexpr int kTrainingNice = 10;  // and meshing

// Lowers the priority of the calling thread, by `nice` steps of the nice value, for training, meshing and
// adjustment, so that threads that serve clients run first. No
// effect on systems without priorities per thread.
void LowerThreadPriority(int nice);

}  // namespace romap
