#pragma once

namespace romap::measure {

// CPU time of this process in user mode, in seconds. Unlike wall time, it is comparable on a shared machine.
double UserSeconds();

}  // namespace romap::measure
