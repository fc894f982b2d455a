#pragma once

#include <absl/status/status.h>

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace romap::http {

enum class Method { kGet, kPost, kDelete };

struct HttpRequest {
  Method method = Method::kGet;
  std::string path = {};  // as sent, e.g. "/api/v1/sessions"; escapes are not decoded, because no name needs them
  std::map<std::string, std::string> query = {};  // decoded; the last value of a name
  std::string authorization = {};                 // the header's value; empty: absent
  std::string host = {};                          // the same
  std::string content_type = {};                  // the media type in lower case, without parameters
  bool has_romap_header = false;                  // X-Romap
  bool accepts_gzip = false;
  std::string body = {};
};

struct HttpResponse {
  int code = 200;
  std::string content_type = "application/json";
  std::string_view body = {};
  std::shared_ptr<const void> body_owner = {};                    // null: `body` is a constant of the program
  std::vector<std::pair<std::string, std::string>> headers = {};  // in addition to those of every response
};

HttpResponse TextResponse(std::string content_type, std::string text);
inline HttpResponse JsonResponse(std::string json) { return TextResponse("application/json", std::move(json)); }
// {"code": ..., "message": ...} with the HTTP code of the status, which is not OK.
HttpResponse ErrorResponse(const absl::Status& status);
// The same object.
std::string StatusJson(const absl::Status& status);

}  // namespace romap::http
