#pragma once

#include <string>

#include "common/config.h"

namespace romap::store {

struct StoreConfig {
  std::string data_dir;
  bool ephemeral = false;
  double commit_period_s = 0.05;
  int max_waiting_mib = 256;
  double max_age_days = 0;
  double max_gib = 0;

  void Fields(ConfigFields& fields) {
    fields.Add("data_dir", &data_dir,
               {.audience = Audience::kOperator,
                .help = "Folder where sessions are stored; empty = $XDG_DATA_HOME/romap or ~/.local/share/romap"});
    fields.Add("ephemeral", &ephemeral, {.help = "Store nothing: sessions end with the server"});
    fields.Add("max_age_days", &max_age_days,
               {.unit = "days",
                .min = 0,
                .max = 36500,
                .audience = Audience::kOperator,
                .help = "Delete sessions that were not used for this time, except pinned ones; 0 = never"});
    fields.Add("max_gib", &max_gib,
               {.unit = "GiB",
                .min = 0,
                .max = 1e6,
                .audience = Audience::kOperator,
                .help = "When all sessions together need more, delete those that were not used for the longest time, "
                        "except open and pinned ones; 0 = no limit"});
    fields.Add("commit_period_s", &commit_period_s,
               {.unit = "s", .min = 0, .max = 1, .help = "Time in which writes are collected for one commit"});
    fields.Add("max_waiting_mib", &max_waiting_mib,
               {.unit = "MiB",
                .min = 1,
                .max = 65536,
                .help = "Maximum memory of writes that wait for a slow disk; beyond it, replay sessions wait and live "
                        "sessions go on without being stored"});
  }
};

}  // namespace romap::store
