#pragma once

namespace romap::bench {

// Peak rate of this machine's multiply-adds in single precision, measured now [GFLOP/s of `threads` threads together,
// two operations each]: independent sums in registers, in the widest instructions there are. The yardstick for times
// that were taken beside other work, or on other machines. Takes about `seconds` [s] of wall time.
double MeasureFmaPeakGflops(int threads, double seconds = 0.05);

}  // namespace romap::bench
