#pragma once

#include <string>

#include "common/config.h"

namespace romap::session {

struct SessionConfig {
  int max_sessions = 16;
  int frame_queue = 8;
  int mapping_queue = 8;
  int subscriber_queue = 65536;
  double statistics_period_s = 0.5;
  std::string record_dir;
  bool single_thread = false;

  void Fields(ConfigFields& fields) {
    fields.Add("max_sessions", &max_sessions,
               {.unit = "sessions", .min = 1, .max = 10000, .help = "Sessions kept at once, finished ones included"});
    fields.Add("frame_queue", &frame_queue,
               {.unit = "frames", .min = 1, .max = 1024, .help = "Frames waiting for tracking before pushing back"});
    fields.Add("mapping_queue", &mapping_queue,
               {.unit = "frames", .min = 1, .max = 1024, .help = "Tracked frames waiting for mapping"});
    fields.Add("subscriber_queue", &subscriber_queue,
               {.unit = "events",
                .min = 16,
                .max = 1 << 20,
                .help = "Acknowledgements kept for a client that does not read; the oldest are dropped beyond it"});
    fields.Add("statistics_period_s", &statistics_period_s,
               {.unit = "s", .min = 0.05, .max = 60, .help = "Time between two statistics messages"});
    fields.Add("record_dir", &record_dir,
               {.help = "Folder for <session id>.romaprec, what each session was fed, for romap replay; empty = none"});
    fields.Add(
        "single_thread", &single_thread,
        {.help = "One thread per session does all in a fixed order: slower, but the same frames give the same map"});
  }
};

}  // namespace romap::session
