#include "server/session/admission.h"

#include <fmt/format.h>

#include <cmath>

namespace romap::session {
namespace {

// Of a session with 640x480 px at 25 Hz. Tracking costs do not depend on the image size alone, so that the size counts
// by its square root.
constexpr double kUsualCores = 0.9;
constexpr double kUsual_mpx = 0.3072;
constexpr int kRetry_s = 10;

double SizeFactor(double image_mpx) { return std::sqrt(image_mpx / kUsual_mpx); }

// Cores of a session of usual size.
double MeanOfMeasured(const std::vector<LiveSession>& sessions) {
  double cores = 0, factors = 0;
  for (const LiveSession& session : sessions) {
    if (!session.cores || *session.cores <= 0) continue;
    cores += *session.cores;
    factors += SizeFactor(session.image_mpx);
  }
  return factors > 0 ? cores / factors : kUsualCores;
}

}  // namespace

absl::Status AdmitLiveSession(const std::vector<LiveSession>& sessions, double image_mpx, double available_cores) {
  if (sessions.empty()) return absl::OkStatus();  // a slow machine may still serve one, and drops frames
  const double usual = MeanOfMeasured(sessions);
  double in_use = 0;
  for (const LiveSession& session : sessions) in_use += session.cores.value_or(usual * SizeFactor(session.image_mpx));
  const double needed = usual * SizeFactor(image_mpx);
  if (in_use + needed <= available_cores) return absl::OkStatus();
  return absl::ResourceExhaustedError(fmt::format(
      "the processor cannot take another live session: {} of them need {:.1f} of the {:.1f} cores that live "
      "sessions may use (session.live_load), and another one would need {:.1f}; try again in {} s, or use "
      "replay mode, which waits",
      sessions.size(), in_use, available_cores, needed, kRetry_s));
}

}  // namespace romap::session
