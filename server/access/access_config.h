#pragma once

#include <string>

#include "common/config.h"

namespace romap::access {

struct AccessConfig {
  std::string token_file;
  int max_sessions_per_tenant = 8;

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
  }
};

}  // namespace romap::access
