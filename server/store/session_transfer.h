#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <string>

#include "server/store/store.h"

namespace romap::store {

// Writes a session that is durable as a session file (session_file.h), in pieces of about 1 MiB. Errors of `write` are
// returned. DATA_LOSS: a part of the session is damaged. NOT_FOUND: there is no such session.
absl::Status SaveSession(const Store& store, const std::string& session,
                         const std::function<absl::Status(std::string piece)>& write);

// Adds the session of a file to the store with another id, for `tenant`. `read` returns the next piece, empty at the
// end. The session is listed when it is complete; after an error or a crash nothing of it remains. INVALID_ARGUMENT:
// the file is damaged or cut off, or has no session.
absl::StatusOr<StoredSession> LoadSession(Store& store, const std::string& new_id, const std::string& tenant,
                                          const std::function<absl::StatusOr<std::string>()>& read);

}  // namespace romap::store
