#pragma once

#include <span>
#include <string_view>

#include "server/http/message.h"

namespace romap::http {

// A file of the page, which the build embeds in the program (deploy/cmake/EmbedFiles.cmake).
struct Asset {
  std::string_view path;  // relative to the root, e.g. "assets/index-1a2b3c.js"
  std::string_view content_type;
  std::string_view data;
  std::string_view gzip;  // the same, compressed; empty: not worth it
};

// The files of client/viewer; empty if the build left them out.
std::span<const Asset> ViewerAssets();

// The file at a path of a request ("/" is index.html, "/camera" camera.html), or a response that says why there is
// none.
HttpResponse AssetResponse(std::span<const Asset> assets, std::string_view path, bool accepts_gzip);

}  // namespace romap::http
