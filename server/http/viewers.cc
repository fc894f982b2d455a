#include "server/http/viewers.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include "common/status.h"
#include "server/http/json.h"

namespace romap::http {
namespace {

constexpr size_t kMaxWaitingBytes = size_t{256} << 10;
constexpr int kMaxEventsPerRound = 512;
constexpr std::chrono::seconds kKeepAlivePeriod{10};
constexpr std::chrono::seconds kTokenCheckPeriod{2};
constexpr std::chrono::seconds kMaxStall{300};
constexpr double kMinAllowance_bytes = 16 << 10;

std::string ServerSentEvent(std::string_view name, std::string_view data) {
  return fmt::format("event: {}\ndata: {}\n\n", name, data);
}

}  // namespace

absl::StatusOr<ViewerOptions> ParseViewerOptions(std::string session_id,
                                                 const std::map<std::string, std::string>& query) {
  ViewerOptions options{.session_id = std::move(session_id)};
  if (const auto found = query.find("meshes"); found != query.end()) {
    if (found->second != "0" && found->second != "1") return InvalidArgument("meshes: must be 0 or 1");
    options.meshes = found->second == "1";
  }
  if (const auto found = query.find("classes"); found != query.end()) options.classes = ParseClasses(found->second);
  if (const auto found = query.find("max_bytes_per_s"); found != query.end()) {
    const std::string& text = found->second;
    double limit = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), limit);
    if (error != std::errc() || end != text.data() + text.size() || !(limit >= 1024 && limit <= 1e12)) {
      return InvalidArgument("max_bytes_per_s: must be a number, 1024 to 1e12");
    }
    options.max_bytes_per_s = limit;
  }
  return options;
}

void Viewers::Add(std::shared_ptr<Exchange> exchange, access::Caller caller, ViewerOptions options,
                  std::unique_ptr<EventStream> stream) {
  const Clock::time_point now = Clock::now();
  Viewer& viewer = viewers_.emplace_back(Viewer{.exchange = std::move(exchange),
                                                .caller = std::move(caller),
                                                .options = options,
                                                .filter = ClassFilter(std::move(options.classes)),
                                                .stream = std::move(stream),
                                                .last_write = now,
                                                .next_check = now + kTokenCheckPeriod,
                                                .last_refill = now});
  viewer.exchange->BeginStream("text/event-stream", kMaxStall);
  Write(viewer, ServerSentEvent("opened", OpenedJson(viewer.options.session_id, viewer.stream->opening())), now);
}

void Viewers::Pump() {
  const Clock::time_point now = Clock::now();
  for (auto viewer = viewers_.begin(); viewer != viewers_.end();) {
    viewer = Pump(*viewer, now) ? std::next(viewer) : viewers_.erase(viewer);
  }
}

bool Viewers::Pump(Viewer& viewer, Clock::time_point now) {
  if (!viewer.exchange->IsConnected()) {
    End(viewer, absl::CancelledError("the client disconnected"));
    return false;
  }
  if (now >= viewer.next_check) {
    viewer.next_check = now + kTokenCheckPeriod;
    if (!viewer.caller.is_valid()) {
      End(viewer, absl::UnauthenticatedError("the token is not valid any longer"));
      return false;
    }
  }
  std::string text;
  const size_t waiting = viewer.exchange->WaitingBytes();
  for (int i = 0; i < kMaxEventsPerRound && waiting + text.size() < kMaxWaitingBytes && HasAllowance(viewer, now);
       ++i) {
    std::optional<MapEvent> event = viewer.stream->Next(std::chrono::milliseconds(0));
    if (!event && viewer.stream->Done()) {
      Write(viewer, text, now);
      End(viewer, viewer.stream->status());
      return false;
    }
    if (!event) break;
    const size_t before = text.size();
    text += ToText(viewer, *std::move(event));
    viewer.allowance_bytes -= static_cast<double>(text.size() - before);
  }
  if (text.empty() && waiting == 0 && now - viewer.last_write >= kKeepAlivePeriod) text = ": keep-alive\n\n";
  Write(viewer, text, now);
  return true;
}

bool Viewers::HasAllowance(Viewer& viewer, Clock::time_point now) const {
  if (!viewer.options.max_bytes_per_s) return true;
  const double limit = *viewer.options.max_bytes_per_s;
  const double elapsed_s = std::chrono::duration<double>(now - viewer.last_refill).count();
  viewer.last_refill = now;
  viewer.allowance_bytes = std::min(viewer.allowance_bytes + limit * elapsed_s, std::max(limit, kMinAllowance_bytes));
  return viewer.allowance_bytes >= 0;
}

// The text of an event, or of none or several according to the options.
std::string Viewers::ToText(Viewer& viewer, MapEvent event) {
  const std::string& session = viewer.options.session_id;
  if (auto* mesh = std::get_if<MeshUpdate>(&event)) {
    if (!viewer.options.meshes) return "";
    const ObjectId id = mesh->id;
    const auto kept = meshes_->Put(session, std::move(*mesh));
    MeshUpdate reference;
    reference.id = id;
    if (viewer.filter.Apply(std::move(reference)).events.empty()) return "";
    return ServerSentEvent("map", MeshJson(*kept));
  }
  ClassFilter::Result filtered = viewer.filter.Apply(std::move(event));
  std::string text;
  for (MapEvent& shown : filtered.events) text += ServerSentEvent("map", EventJson(std::move(shown)));
  if (filtered.joined && viewer.options.meshes) {
    if (const auto mesh = meshes_->Find(session, filtered.joined)) text += ServerSentEvent("map", MeshJson(*mesh));
  }
  return text;
}

void Viewers::Write(Viewer& viewer, const std::string& text, Clock::time_point now) const {
  if (text.empty()) return;
  viewer.exchange->Write(text);
  viewer.last_write = now;
}

void Viewers::End(Viewer& viewer, const absl::Status& status) {
  if (viewer.exchange->IsConnected()) viewer.exchange->Write(ServerSentEvent("end", StatusJson(status)));
  viewer.exchange->EndStream();
  // The stream may be the last owner of its session.
  pool_->Dispose(
      [stream = std::move(viewer.stream), service = std::move(viewer.caller.service)]() mutable { stream.reset(); });
}

void Viewers::EndAll(const absl::Status& status) {
  for (Viewer& viewer : viewers_) End(viewer, status);
  viewers_.clear();
}

}  // namespace romap::http
