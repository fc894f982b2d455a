#include "server/http/json.h"

#include <google/protobuf/util/json_util.h>

#include <utility>

#include "common/status.h"
#include "common/wire/events.h"
#include "common/wire/sessions.h"

namespace romap::http {
namespace {

constexpr size_t kMaxJsonBytes = size_t{64} << 10;

MeshUpdate WithoutBytes(const MeshUpdate& mesh) {
  MeshUpdate stripped;
  stripped.id = mesh.id;
  stripped.revision = mesh.revision;
  stripped.steps = mesh.steps;
  stripped.train_seconds = mesh.train_seconds;
  stripped.final = mesh.final;
  stripped.vertex_count = mesh.vertex_count;
  stripped.triangle_count = mesh.triangle_count;
  stripped.texture.media_type = mesh.texture.media_type;
  for (const MeshLevel& level : mesh.levels) {
    stripped.levels.push_back({.draco = "", .triangle_count = level.triangle_count, .error_mu = level.error_mu});
  }
  stripped.next_view = mesh.next_view;
  return stripped;
}

}  // namespace

std::string ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  std::string json;
  // It fails only for messages of unknown types.
  (void)google::protobuf::util::MessageToJsonString(message, &json, options);
  return json;
}

absl::Status FromJson(const std::string& json, google::protobuf::Message* message) {
  if (json.size() > kMaxJsonBytes) {
    return InvalidArgument("the body has {} bytes; JSON must have at most {}", json.size(), kMaxJsonBytes);
  }
  const auto status = google::protobuf::util::JsonStringToMessage(json, message);
  if (status.ok()) return absl::OkStatus();
  return InvalidArgument("the body is not a {} in JSON: {}", message->GetDescriptor()->name(),
                         std::string(status.message().data(), status.message().size()));
}

std::string OpenedJson(const std::string& session_id, StreamOpening opening) {
  opening.resume_token.clear();  // it would let a viewer take over the stream that feeds the session
  return ToJson(wire::ToProto(session_id, std::move(opening)));
}

std::string EventJson(MapEvent event) {
  if (const auto* mesh = std::get_if<MeshUpdate>(&event)) return MeshJson(*mesh);
  return ToJson(wire::ToProto(std::move(event)));
}

std::string MeshJson(const MeshUpdate& mesh) {
  std::string json = ToJson(wire::ToProto(MapEvent(WithoutBytes(mesh))));
  std::string levels;
  for (const MeshLevel& level : mesh.levels) {
    levels += fmt::format("{}{}", levels.empty() ? "" : ",", level.draco.size());
  }
  json.pop_back();  // the closing brace
  return json + fmt::format(R"(,"bytes":{{"draco":{},"texture":{},"levels":[{}]}}}})", mesh.draco.size(),
                            mesh.texture.image.size(), levels);
}

}  // namespace romap::http
