#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <list>
#include <memory>
#include <optional>
#include <string>

#include "common/mapping_service.h"
#include "server/access/authenticator.h"
#include "server/http/class_filter.h"
#include "server/http/exchange.h"
#include "server/http/mesh_cache.h"
#include "server/http/worker_pool.h"

namespace romap::http {

// What a viewer wants to see.
struct ViewerOptions {
  std::string session_id;
  bool meshes = true;
  std::set<std::string> classes = {};          // empty: all
  std::optional<double> max_bytes_per_s = {};  // of the events; nullopt: no limit
};

// The options in the query of a request. INVALID_ARGUMENT: a value that cannot be read.
absl::StatusOr<ViewerOptions> ParseViewerOptions(std::string session_id,
                                                 const std::map<std::string, std::string>& query);

// The event streams of all viewers. Pump() moves events from the sessions to the clients without waiting. Events of a
// client that does not read wait in the outbox of its stream, where newer ones replace them. On the loop's thread.
class Viewers {
 public:
  // Both outlive the viewers. The pool closes streams, because that may take time.
  Viewers(MeshCache* meshes, WorkerPool* pool) : meshes_(meshes), pool_(pool) {}
  ~Viewers() { EndAll(absl::UnavailableError("the server is shutting down")); }

  void Add(std::shared_ptr<Exchange> exchange, access::Caller caller, ViewerOptions options,
           std::unique_ptr<EventStream> stream);
  // Call about every 30 ms.
  void Pump();
  void EndAll(const absl::Status& status);

  size_t size() const { return viewers_.size(); }

 private:
  using Clock = std::chrono::steady_clock;
  struct Viewer {
    std::shared_ptr<Exchange> exchange;
    access::Caller caller;
    ViewerOptions options;
    ClassFilter filter;
    std::shared_ptr<EventStream> stream;
    Clock::time_point last_write, next_check;  // of the token
    Clock::time_point last_refill;
    double allowance_bytes = 0;  // only with a limit
  };

  // False: the stream has ended.
  bool Pump(Viewer& viewer, Clock::time_point now);
  bool HasAllowance(Viewer& viewer, Clock::time_point now) const;
  std::string ToText(Viewer& viewer, MapEvent event);
  void Write(Viewer& viewer, const std::string& text, Clock::time_point now) const;
  void End(Viewer& viewer, const absl::Status& status);

  MeshCache* const meshes_;
  WorkerPool* const pool_;
  std::list<Viewer> viewers_;
};

}  // namespace romap::http
