#pragma once

#include <cstddef>

namespace romap::measure {

// Measured peak rates of one core of this machine, for a roofline (Williams, Waterman, Patterson: "Roofline: an
// insightful visual performance model for multicore architectures", 2009).

// Multiply-adds on independent vectors in registers, with the widest available instruction set; one multiply-add counts
// as two operations [floating-point operations per second].
double PeakFlopPerSecond();

// Loads of 16 bytes at random positions in a table of `table_bytes`, all positions known in advance [s per load].
double RandomLoadSeconds(size_t table_bytes);

// The same, with an addition and a store [s per update].
double RandomUpdateSeconds(size_t table_bytes);

// Reading and writing an array of `array_bytes` sequentially [bytes per second; each byte counts twice, as read and as
// written].
double StreamBytesPerSecond(size_t array_bytes);

}  // namespace romap::measure
