#pragma once

#include <cstdint>
#include <string>

namespace romap::cuda_on_host {

// Finds accesses of two CUDA threads to the same shared or device memory, one of them a write and not both atomic, with
// no barrier between them. Link the library romap_cuda_race_checker into a program whose kernels were compiled with
// -fsanitize=thread (and linked without it): it takes the place of the thread sanitizer's runtime.
//
// Threads of different blocks are never ordered within a launch; threads of one block are ordered by any __syncthreads
// that lies between, lanes of one warp also by __syncwarp, but by no other warp collective. Only the last write and the
// last two readers of each word are remembered, so a race can be missed, but what is reported is one.

int RaceCount();
// What the first race was: kind of memory, blocks and threads; empty when there was none.
std::string FirstRace();
void ResetRaces();

// Bytes that kernels moved to and from device memory since the last call; threads that read the same word each count.
struct DeviceTraffic {
  uint64_t read = 0, written = 0, atomic = 0;
};
DeviceTraffic TakeDeviceTraffic();

}  // namespace romap::cuda_on_host
