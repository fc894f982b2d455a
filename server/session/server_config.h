#pragma once

#include "common/config.h"
#include "server/mesh/mesh_config.h"
#include "server/nerf/nerf_config.h"
#include "server/objects/objects_config.h"
#include "server/session/session_config.h"
#include "server/slam/slam_config.h"

namespace romap::session {

// The configuration of a mapping service, one struct per stage. It does not change after the service is created.
struct ServerConfig {
  slam::SlamConfig slam;
  objects::ObjectsConfig objects;
  nerf::NerfConfig nerf;
  mesh::MeshConfig mesh;
  SessionConfig session;
  int training_threads = 0;

  void Fields(ConfigFields& fields) {
    fields.Section("session");
    session.Fields(fields);
    fields.Section("slam");
    slam.Fields(fields);
    fields.Section("objects");
    objects.Fields(fields);
    fields.Section("nerf");
    fields.Add("training_threads", &training_threads,
               {.unit = "threads",
                .min = 0,
                .max = 1024,
                .audience = Audience::kOperator,
                .help = "Number of threads that train fields; 0 = one per core"});
    nerf.Fields(fields);
    fields.Section("mesh");
    mesh.Fields(fields);
    fields.AddRules([this](ConfigRules& rules) { Validate(rules); });
  }

  // The rules between stages; those within a stage belong to its struct.
  void Validate(ConfigRules& rules) const {
    rules.RequireAtMost(&nerf.min_views, &objects.max_views);
    rules.Forbid(session.single_thread && training_threads > 0, &training_threads, "has no effect with",
                 &session.single_thread, "leave one of them at its default");
  }
};

}  // namespace romap::session
