#include "server/access/authenticator.h"

#include <utility>

#include "server/access/tenant_service.h"

namespace romap::access {

bool Authenticator::NeedsToken() const {
  if (!had_tokens_ && tokens_.Exists()) had_tokens_ = true;
  return had_tokens_;
}

std::shared_ptr<TenantLimits> Authenticator::LimitsOf(const std::string& tenant) const {
  std::lock_guard lock(mutex_);
  std::shared_ptr<TenantLimits>& limits = limits_[tenant];
  if (!limits) limits = std::make_shared<TenantLimits>(config_);
  return limits;
}

absl::StatusOr<Caller> Authenticator::Authenticate(std::string_view authorization) const {
  constexpr std::string_view kScheme = "Bearer ";
  if (!NeedsToken()) {
    // The service outlives all callers.
    return Caller{.service = std::shared_ptr<MappingService>(service_, [](MappingService*) {}),
                  .is_valid = [this] { return !NeedsToken(); },
                  .is_admin = true};
  }
  if (!authorization.starts_with(kScheme)) {
    return absl::UnauthenticatedError(
        "this server needs a token, as metadata 'authorization: Bearer TOKEN' (romap: --token-file FILE)");
  }
  std::string token(authorization.substr(kScheme.size()));
  std::optional<Identity> identity = tokens_.Find(token);
  if (!identity) return absl::UnauthenticatedError("the token is not valid: it is unknown or was revoked");
  const bool is_admin = identity->role == Role::kAdmin;
  std::shared_ptr<TenantLimits> limits = LimitsOf(identity->tenant);
  return Caller{.service = std::make_shared<TenantService>(service_, *std::move(identity), std::move(limits)),
                .is_valid = [this, token = std::move(token)] { return tokens_.Find(token).has_value(); },
                .is_admin = is_admin};
}

}  // namespace romap::access
