#pragma once

#include <cstdint>
#include <string>

namespace romap::cuda_on_host {

// Reports races: accesses of two CUDA threads to the same shared or device memory without a barrier between them, at
// least one of them a write and not both atomic. Link the library romap_cuda_race_checker to a program whose kernels
// are compiled with -fsanitize=thread (but not linked with it): it replaces the runtime of the thread sanitizer.
//
// Threads of different blocks are never ordered within a launch. Threads of one block are ordered by a __syncthreads
// between the accesses, lanes of one warp also by __syncwarp, but by no other warp collective. Only the last write and
// the last two readers of each word are stored, so a race can be missed, but there are no false reports.

int RaceCount();
// Description of the first race: kind of memory, blocks and threads; empty without races.
std::string FirstRace();
void ResetRaces();

// Bytes that kernels read from and wrote to device memory since the last call, counted per thread.
struct DeviceTraffic {
  uint64_t read = 0, written = 0, atomic = 0;
};
DeviceTraffic TakeDeviceTraffic();

}  // namespace romap::cuda_on_host
