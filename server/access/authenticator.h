#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "common/mapping_service.h"
#include "server/access/access_config.h"
#include "server/access/tenant_limits.h"
#include "server/access/token_store.h"

namespace romap::access {

// The caller of one call.
struct Caller {
  std::shared_ptr<MappingService> service;  // as the caller sees it
  std::function<bool()> is_valid;           // false once the caller's token was revoked
  bool is_admin = false;                    // may see what concerns all tenants
};

// Finds out who makes a call. Thread-safe.
class Authenticator {
 public:
  // `service` outlives this object. Without a file of tokens, everybody may do everything. The file may appear and
  // change at any time. If it disappears, no token is valid any longer: a lost file must not open the server.
  Authenticator(MappingService* service, const std::string& token_file, const AccessConfig& config)
      : service_(service), config_(config), tokens_(token_file) {}

  bool NeedsToken() const;
  // `authorization`: the value of the metadata of this name, "Bearer TOKEN"; empty: there is none. UNAUTHENTICATED: a
  // valid token is needed.
  absl::StatusOr<Caller> Authenticate(std::string_view authorization) const;

 private:
  std::shared_ptr<TenantLimits> LimitsOf(const std::string& tenant) const;

  MappingService* const service_;
  const AccessConfig config_;
  const TokenStore tokens_;
  mutable std::atomic<bool> had_tokens_ = false;
  mutable std::mutex mutex_;
  mutable std::map<std::string, std::shared_ptr<TenantLimits>> limits_;  // by tenant; guarded by mutex_
};

}  // namespace romap::access
