#pragma once

#include <chrono>

#include "common/client_input.h"

namespace romap::session {

// An input of a client with its time of arrival at the server.
struct Arrival {
  SessionInput input;
  std::chrono::steady_clock::time_point time;
};

}  // namespace romap::session
