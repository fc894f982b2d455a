#include "server/http/request_reader.h"

#include <event2/buffer.h>
#include <event2/http.h>
#include <event2/keyvalq_struct.h>

#include <algorithm>
#include <cctype>

#include "common/status.h"

namespace romap::http {
namespace {

std::string HeaderOf(evhttp_request* request, const char* name) {
  const char* value = evhttp_find_header(evhttp_request_get_input_headers(request), name);
  return value == nullptr ? "" : value;
}

std::string MediaTypeOf(const std::string& content_type) {
  std::string type = content_type.substr(0, content_type.find(';'));
  while (!type.empty() && std::isspace(static_cast<unsigned char>(type.back())) != 0) type.pop_back();
  std::ranges::transform(type, type.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return type;
}

Method MethodOf(evhttp_request* request) {
  switch (evhttp_request_get_command(request)) {
    case EVHTTP_REQ_POST:
      return Method::kPost;
    case EVHTTP_REQ_DELETE:
      return Method::kDelete;
    default:
      return Method::kGet;  // evhttp refuses all others
  }
}

}  // namespace

absl::StatusOr<HttpRequest> ReadRequest(evhttp_request* request) {
  HttpRequest read{.method = MethodOf(request)};
  const evhttp_uri* uri = evhttp_request_get_evhttp_uri(request);
  const char* path = uri == nullptr ? nullptr : evhttp_uri_get_path(uri);
  if (path == nullptr || *path != '/') return InvalidArgument("the request has no path");
  read.path = path;
  if (const char* query = evhttp_uri_get_query(uri); query != nullptr && *query != '\0') {
    evkeyvalq pairs{};
    if (evhttp_parse_query_str(query, &pairs) != 0) return InvalidArgument("the query cannot be parsed");
    for (const evkeyval* pair = pairs.tqh_first; pair != nullptr; pair = pair->next.tqe_next) {
      read.query[pair->key] = pair->value;
    }
    evhttp_clear_headers(&pairs);
  }
  read.authorization = HeaderOf(request, "Authorization");
  read.host = HeaderOf(request, "Host");
  read.content_type = MediaTypeOf(HeaderOf(request, "Content-Type"));
  read.has_romap_header = !HeaderOf(request, "X-Romap").empty();
  read.accepts_gzip = HeaderOf(request, "Accept-Encoding").find("gzip") != std::string::npos;
  evbuffer* body = evhttp_request_get_input_buffer(request);
  read.body.resize(evbuffer_get_length(body));
  if (!read.body.empty()) evbuffer_remove(body, read.body.data(), read.body.size());
  return read;
}

}  // namespace romap::http
