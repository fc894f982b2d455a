#pragma once

#include <string>

#include "common/config.h"

namespace romap::session {

struct SessionConfig {
  int max_sessions = 16;
  double max_image_mpx = 40;
  double live_load = 0.85;
  int frame_queue = 8;
  int mapping_queue = 8;
  int subscriber_queue = 65536;
  double statistics_period_s = 0.5;
  double unload_after_s = 600;
  double abandon_after_s = 600;
  double stage_timeout_s = 180;
  std::string record_dir;
  bool single_thread = false;

  void Fields(ConfigFields& fields) {
    fields.Add("max_sessions", &max_sessions,
               {.unit = "sessions",
                .min = 1,
                .max = 10000,
                .audience = Audience::kOperator,
                .help = "Maximum number of sessions in memory: open ones, and without a store also finished ones"});
    fields.Add("max_image_mpx", &max_image_mpx,
               {.unit = "megapixels",
                .min = 0.1,
                .max = 67.2,
                .help = "Largest images of a session; an image needs about 20 bytes of memory per pixel while it waits "
                        "and is tracked"});
    fields.Add("live_load", &live_load,
               {.min = 0,
                .max = 100,
                .help = "Share of all cores that tracking and mapping of live sessions may need; a live session that "
                        "would exceed it is refused; 0 = no limit"});
    fields.Add("frame_queue", &frame_queue,
               {.unit = "frames",
                .min = 1,
                .max = 1024,
                .help = "Maximum number of frames waiting for tracking; when it is reached, replay sessions wait and "
                        "live sessions drop the oldest frame"});
    fields.Add(
        "mapping_queue", &mapping_queue,
        {.unit = "frames", .min = 1, .max = 1024, .help = "Maximum number of tracked frames waiting for mapping"});
    fields.Add("subscriber_queue", &subscriber_queue,
               {.unit = "acknowledgements",
                .min = 16,
                .max = 1 << 20,
                .help = "Maximum number of acknowledgements waiting for a client that does not read; beyond it, the "
                        "oldest ones are dropped"});
    fields.Add("statistics_period_s", &statistics_period_s,
               {.unit = "s", .min = 0.05, .max = 60, .help = "Time between two statistics messages"});
    fields.Add("unload_after_s", &unload_after_s,
               {.unit = "s",
                .min = 0,
                .max = 1e6,
                .help = "Time after which an open session that nobody uses gives back its memory; it is restored from "
                        "the store when a client opens it"});
    fields.Add("abandon_after_s", &abandon_after_s,
               {.unit = "s",
                .min = 0,
                .max = 1e6,
                .help = "Time after which a session is deleted that got no frame and has no stream; 0 = never"});
    fields.Add(
        "stage_timeout_s", &stage_timeout_s,
        {.unit = "s",
         .min = 0,
         .max = 1e6,
         .help = "Time after which a stage that works on one frame counts as hanging, and its session as failed; "
                 "0 = never"});
    fields.Add("record_dir", &record_dir,
               {.help = "Folder where the input of every session is recorded as <session id>.romaprec for romap "
                        "replay; empty = no recording"});
    fields.Add("single_thread", &single_thread,
               {.help = "Run every session on one thread in a fixed order: slower, but the same input gives the same "
                        "map"});
  }
};

}  // namespace romap::session
