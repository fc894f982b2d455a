#pragma once

#include <string>

namespace romap::access {

// What a token allows. Each role includes those before it.
enum class Role {
  kViewer,  // reads the sessions of its tenant
  kOwner,   // creates, feeds, finishes and deletes them
  kAdmin,   // all of this for the sessions of all tenants
};

// Who makes a call.
struct Identity {
  std::string token_id;
  std::string tenant;  // not empty
  Role role = Role::kViewer;
};

}  // namespace romap::access
