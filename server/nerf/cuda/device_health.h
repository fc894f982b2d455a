#pragma once

#include <absl/status/status.h>

namespace romap::nerf::cuda {

// The device of this process: device 0. It is tried at the first call: OK, or UNAVAILABLE, in one line, when there is
// none or no driver, when it fails at running a kernel of this build, or once MarkUnhealthy was called. Thread-safe.
absl::Status DeviceStatus();

// The device failed while it worked: nobody is to use it again. The first call says so in the log. Thread-safe.
void MarkUnhealthy(const absl::Status& why);

// The device is tried anew by the next call of DeviceStatus; for programs that pretend another machine.
void ForgetDevice();

}  // namespace romap::nerf::cuda
