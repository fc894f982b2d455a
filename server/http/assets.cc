#include "server/http/assets.h"

#include <algorithm>

#include "common/status.h"

namespace romap::http {
namespace {

std::string_view FileOf(std::string_view path) {
  if (path == "/") return "index.html";
  if (path == "/camera" || path == "/camera/") return "camera.html";
  return path.substr(1);
}

}  // namespace

HttpResponse AssetResponse(std::span<const Asset> assets, std::string_view path, bool accepts_gzip) {
  if (assets.empty() && (path == "/" || path == "/camera")) {
    return TextResponse("text/plain; charset=utf-8",
                        "This romap-server was built without its page, because Node.js and npm were missing.\n"
                        "Its HTTP interface is complete; it begins at /api/v1/sessions.\n");
  }
  const auto found = std::ranges::find(assets, FileOf(path), &Asset::path);
  if (found == assets.end()) return ErrorResponse(NotFound("there is no such page"));
  const bool is_gzip = accepts_gzip && !found->gzip.empty();
  // Names below assets/ contain a hash of the content.
  const bool is_immutable = found->path.starts_with("assets/");
  HttpResponse response{
      .content_type = std::string(found->content_type),
      .body = is_gzip ? found->gzip : found->data,
      .headers = {{"Cache-Control", is_immutable ? "public, max-age=31536000, immutable" : "no-cache"},
                  {"Vary", "Accept-Encoding"}}};
  if (is_gzip) response.headers.emplace_back("Content-Encoding", "gzip");
  return response;
}

}  // namespace romap::http
