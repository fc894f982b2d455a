#pragma once

#include <absl/status/status.h>

#include <optional>
#include <vector>

namespace romap::session {

// What an admitted live session needs of the processor.
struct LiveSession {
  double image_mpx = 0;              // megapixels
  std::optional<double> cores = {};  // measured, see LiveLoad; nullopt: not known yet
};

// Whether the processor can also take a new live session with images of this size, so that those that it has keep their
// rate. A session that has not been measured is assumed to need what the measured ones need per pixel, or what is
// usual. RESOURCE_EXHAUSTED: no; the message says what is in use and when to try again. `available_cores`: for live
// sessions.
absl::Status AdmitLiveSession(const std::vector<LiveSession>& sessions, double image_mpx, double available_cores);

}  // namespace romap::session
