// Bodies of HTTP requests in JSON, and the words in paths and headers.

#include "common/status.h"
#include "common/wire/sessions.h"
#include "romap/v1/mapping.pb.h"
#include "server/http/class_filter.h"
#include "server/http/json.h"
#include "server/http/request_check.h"
#include "server/http/route.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/quiet_protobuf.h"

std::vector<std::string> romap::fuzz::Seeds() {
  return {R"({"name":"kitchen","camera":{"widthPx":640,"heightPx":480,"fxPx":500,"distortion":[0.1,0,0,0,0]}})",
          R"({"mode":"FRAME_MODE_LIVE","poseUse":3,"upWorld":{"z":1},"estimateUp":true})",
          R"({"sessionId":"12ab","pinned":true})",
          "/api/v1/sessions/12ab/objects/3/mesh/45/levels/1",
          "/api/v1/sessions/a/objects/9.glb",
          "localhost:8080",
          "[::1]:8080",
          "cup,book,,pen"};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  const std::string text = fuzz::TextOf(data, size);
  v1::CreateSessionRequest session;
  if (http::FromJson(text, &session).ok()) {
    v1::CreateSessionRequest again;
    fuzz::Require(http::FromJson(http::ToJson(session), &again).ok(), "JSON that was written can be read");
    (void)wire::FromProto(session);
  }
  v1::PinSessionRequest pin;
  (void)http::FromJson(text, &pin);
  for (const http::Method method : {http::Method::kGet, http::Method::kPost, http::Method::kDelete}) {
    (void)http::ParseRoute(method, text);
  }
  (void)http::IsLocalOrNumber(text);
  for (const std::string& name : http::ParseClasses(text)) {
    fuzz::Require(text.find(name) != std::string::npos, "classes are parts of the text");
  }
  return 0;
}
