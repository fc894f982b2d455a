#include "server/http/message.h"

#include <nlohmann/json.hpp>

#include "common/printable.h"
#include "common/status.h"

namespace romap::http {
namespace {

int HttpCode(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kOk:
      return 200;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return 400;
    case absl::StatusCode::kUnauthenticated:
      return 401;
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kNotFound:
      return 404;
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kAborted:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kCancelled:
      return 409;
    case absl::StatusCode::kResourceExhausted:
      return 429;
    case absl::StatusCode::kUnimplemented:
      return 501;
    case absl::StatusCode::kUnavailable:
      return 503;
    case absl::StatusCode::kDeadlineExceeded:
      return 504;
    default:
      return 500;
  }
}

}  // namespace

HttpResponse TextResponse(std::string content_type, std::string text) {
  auto owner = std::make_shared<const std::string>(std::move(text));
  return {.content_type = std::move(content_type), .body = *owner, .body_owner = owner};
}

std::string StatusJson(const absl::Status& status) {
  // Messages quote input, which may not be UTF-8.
  return nlohmann::json{{"code", std::string(absl::StatusCodeToString(status.code()))},
                        {"message", Printable(Message(status))}}
      .dump();
}

HttpResponse ErrorResponse(const absl::Status& status) {
  HttpResponse response = JsonResponse(StatusJson(status));
  response.code = HttpCode(status.code());
  if (response.code == 401) response.headers.emplace_back("WWW-Authenticate", "Bearer");
  if (response.code == 429 || response.code == 503) response.headers.emplace_back("Retry-After", "1");
  return response;
}

}  // namespace romap::http
