#pragma once

#include "server/access/access_config.h"
#include "server/access/rate_limit.h"

namespace romap::access {

// What one tenant may use, all its callers together. Thread-safe.
struct TenantLimits {
  explicit TenantLimits(const AccessConfig& config)
      : max_sessions(config.max_sessions_per_tenant),
        max_stored_bytes(config.max_stored_gib_per_tenant * 0x1p30),
        inputs(config.max_inputs_per_s_per_tenant),
        input_bytes(config.max_mib_per_s_per_tenant * 0x1p20) {}

  const int max_sessions;         // that are not finished
  const double max_stored_bytes;  // 0: no limit
  RateLimit inputs;               // frames and late masks
  RateLimit input_bytes;
};

}  // namespace romap::access
