#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "common/mapping_service.h"
#include "romap/v1/mapping.pb.h"

namespace romap::wire {

// FromProto returns INVALID_ARGUMENT "<field>: ..." for a missing camera, an unknown enum value or an invalid number.

v1::CreateSessionRequest ToProto(const SessionOptions& options);
absl::StatusOr<SessionOptions> FromProto(const v1::CreateSessionRequest& proto);

v1::SessionInfo ToProto(const SessionInfo& info);
absl::StatusOr<SessionInfo> FromProto(const v1::SessionInfo& proto, const std::string& where);

// The first message of a stream.
v1::StreamOpened ToProto(const std::string& session_id, StreamOpening opening);
StreamOpening FromProto(v1::StreamOpened proto);

// The messages of an export in sending order: header, objects, pieces of the trajectory. Only a part with a very large
// mesh can exceed the message limit.
std::vector<v1::ExportMapResponse> ToProto(MapSnapshot snapshot);

// Assembles a snapshot from the messages of an export.
class SnapshotAssembler {
 public:
  // INVALID_ARGUMENT: the part is malformed or out of order. Parts of an unknown kind are skipped.
  absl::Status Add(v1::ExportMapResponse part);
  // Call once, after the last part. INVALID_ARGUMENT: there was no header.
  absl::StatusOr<MapSnapshot> Take();

 private:
  MapSnapshot snapshot_;
  bool has_header_ = false;
};

}  // namespace romap::wire
