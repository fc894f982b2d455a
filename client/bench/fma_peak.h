#pragma once

namespace romap::bench {

// Measures the current peak rate of single-precision multiply-adds [GFLOP/s, sum of `threads` threads, two operations
// per multiply-add] with independent sums in registers and the widest instructions of the CPU. Makes times comparable
// that were measured under load or on different machines. Takes about `seconds` [s] of wall time.
double MeasureFmaPeakGflops(int threads, double seconds = 0.05);

}  // namespace romap::bench
