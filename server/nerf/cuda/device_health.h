#pragma once

#include <absl/status/status.h>

namespace romap::nerf::cuda {

// Status of device 0, the device of this process, tested at the first call. UNAVAILABLE, in one line, if there is no
// device or driver, if a kernel of this build fails on it, or after MarkUnhealthy. Thread-safe.
absl::Status DeviceStatus();

// Reports that the device failed; it is not used again in this process. The first call is logged. Thread-safe.
void MarkUnhealthy(const absl::Status& reason);

}  // namespace romap::nerf::cuda
