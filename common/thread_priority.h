#pragma once

namespace romap {

// Steps of the nice value below the threads that track and map, the most urgent first. With all cores busy, a thread at
// 19 gets about one per cent of a core.
inline constexpr int kLocalAdjustmentNice = 5;
inline constexpr int kGlobalAdjustmentNice = 10;
inline constexpr int kTrainingNice = 19;  // and meshing

// Lowers the priority of the calling thread, by `nice` steps of the nice value, for training, meshing and
// adjustment, so that threads that serve clients run first. No
// effect on systems without priorities per thread.
void LowerThreadPriority(int nice);

}  // namespace romap
