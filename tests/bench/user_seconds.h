#pragma once

namespace romap::measure {

// CPU time that this process has spent outside the kernel [s]: what benchmarks on shared machines compare.
double UserSeconds();

}  // namespace romap::measure
