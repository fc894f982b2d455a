#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "common/diagnostic.h"
#include "server/objects/objects_config.h"

namespace romap::objects {

// States why a session with instance masks ends without a confirmed object.
class ConfirmationReport {
 public:
  void CountMaskedFrame(bool has_pose);
  // At the end of the session, for each landmark.
  void AddConfirmed() { ++confirmed_; }
  void AddUnconfirmed(const std::string& reason) { ++unconfirmed_[reason]; }

  // nullopt: an object was confirmed, or there were no masks.
  std::optional<Diagnostic> Check(const ObjectsConfig& config) const;

 private:
  uint64_t masked_frames_ = 0;
  uint64_t frames_with_pose_ = 0;  // of those with masks
  int confirmed_ = 0;
  std::map<std::string, int> unconfirmed_ = {};  // number of landmarks by reason
};

}  // namespace romap::objects
