#pragma once

#include <absl/status/status.h>

#include <string_view>

#include "server/http/message.h"

namespace romap::http {

// Whether the value of a Host header is "localhost" or a number, with or without a port. A name that a foreign page
// made lead to this machine (DNS rebinding) is neither.
bool IsLocalOrNumber(std::string_view host);

// What is required of a request before it is looked at. PERMISSION_DENIED: on a loopback address, the Host header is a
// name. INVALID_ARGUMENT: a request that changes something has neither the content type `application/json` (for frames
// `image/jpeg`) nor the header X-Romap, which pages of other origins cannot send.
absl::Status CheckRequest(const HttpRequest& request, bool is_loopback);

}  // namespace romap::http
