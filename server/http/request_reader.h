#pragma once

#include <absl/status/statusor.h>

#include "server/http/message.h"

struct evhttp_request;

namespace romap::http {

// The parts of a request that are used. INVALID_ARGUMENT: its query cannot be parsed.
absl::StatusOr<HttpRequest> ReadRequest(evhttp_request* request);

}  // namespace romap::http
