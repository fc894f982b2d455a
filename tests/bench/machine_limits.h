#pragma once

#include <cstddef>

namespace romap::measure {

// What one core of this machine can do at best, measured: the yardsticks of a roofline (Williams, Waterman, Patterson:
// "Roofline: an insightful visual performance model for multicore architectures", 2009).

// Multiply-adds on independent vectors in registers, of the widest instruction set that the field engine would use;
// one multiply-add counts as two [floating-point operations per second].
double PeakFlopPerSecond();

// Loads of 16 bytes at random places of a table of `table_bytes`, all places known in advance [s per load].
double RandomLoadSeconds(size_t table_bytes);

// The same, adding a vector to what is there [s per update].
double RandomUpdateSeconds(size_t table_bytes);

// Reading and writing back an array of `array_bytes` from one end to the other [bytes per second; each byte counts once
// as read and once as written].
double StreamBytesPerSecond(size_t array_bytes);

}  // namespace romap::measure
