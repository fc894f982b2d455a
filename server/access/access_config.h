#pragma once

#include <string>

#include "common/config.h"

namespace romap::access {

struct AccessConfig {
  std::string token_file;
  int max_sessions_per_tenant = 8;
  double max_inputs_per_s_per_tenant = 0;
  double max_mib_per_s_per_tenant = 0;
  double max_stored_gib_per_tenant = 0;

  void Fields(ConfigFields& fields) {
    fields.Add(
        "token_file", &token_file,
        {.audience = Audience::kOperator,
         .help = "File of the tokens (romap-server token); empty = tokens.json in the data folder. If it exists, "
                 "every call needs a token"});
    fields.Add("max_sessions_per_tenant", &max_sessions_per_tenant,
               {.unit = "sessions",
                .min = 1,
                .max = 10000,
                .help = "Maximum number of sessions of one tenant that are not finished"});
    fields.Add(
        "max_inputs_per_s_per_tenant", &max_inputs_per_s_per_tenant,
        {.unit = "1/s",
         .min = 0,
         .max = 1e6,
         .help = "Maximum rate of the frames and late masks of one tenant; faster senders are slowed down; 0 = no "
                 "limit"});
    fields.Add("max_mib_per_s_per_tenant", &max_mib_per_s_per_tenant,
               {.unit = "MiB/s", .min = 0, .max = 1e6, .help = "The same for the size of the inputs; 0 = no limit"});
    fields.Add("max_stored_gib_per_tenant", &max_stored_gib_per_tenant,
               {.unit = "GiB",
                .min = 0,
                .max = 1e6,
                .help = "A tenant whose sessions need more on the disk cannot create, load or feed sessions; 0 = no "
                        "limit"});
  }
};

}  // namespace romap::access
