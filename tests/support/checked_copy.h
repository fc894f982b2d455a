#pragma once

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

#include "client/sdk/map_copy.h"
#include "common/wire/events.h"

namespace romap::testing {

// A client's copy of a map that checks on the way what every stream of events promises: nothing is said of an object
// before its first update nor after its end, and revisions grow.
class CheckedCopy {
 public:
  void Apply(const MapEvent& event) {
    if (const auto* update = std::get_if<ObjectUpdate>(&event)) {
      EXPECT_FALSE(gone_.contains(update->id)) << update->id << " is back";
      EXPECT_GT(update->revision, revision_[update->id]) << update->id;
      revision_[update->id] = update->revision;
    } else if (const auto* mesh = std::get_if<MeshUpdate>(&event)) {
      ExpectKnown(mesh->id, "mesh");
      EXPECT_GT(mesh->revision, mesh_revision_[mesh->id]) << mesh->id;
      mesh_revision_[mesh->id] = mesh->revision;
    } else if (const auto* removed = std::get_if<ObjectRemoved>(&event)) {
      ExpectKnown(removed->id, "removed");
      EXPECT_GT(removed->revision, revision_[removed->id]) << removed->id;
      gone_.insert(removed->id);
    } else if (const auto* merged = std::get_if<ObjectMerged>(&event)) {
      ExpectKnown(merged->from, "merged away");
      ExpectKnown(merged->into, "merged into");
      // Two that went the same way may arrive at one revision.
      EXPECT_GE(merged->revision, revision_[merged->into]) << merged->into;
      revision_[merged->into] = merged->revision;
      gone_.insert(merged->from);
    }
    copy_.Apply(event);
  }

  // All there is, every field, as bytes by object.
  std::map<ObjectId, std::string> Bytes() const {
    std::map<ObjectId, std::string> bytes;
    for (const auto& [id, snapshot] : copy_.objects()) bytes[id] = ToBytes(snapshot);
    return bytes;
  }
  static std::string ToBytes(const ObjectSnapshot& snapshot) {
    return wire::ToProto(snapshot.object).DebugString() +
           (snapshot.mesh ? wire::ToProto(*snapshot.mesh).DebugString() : "no mesh");
  }

 private:
  void ExpectKnown(ObjectId id, const char* what) const {
    EXPECT_TRUE(copy_.objects().contains(id)) << what << ": " << id << " is not known";
  }

  client::MapCopy copy_;
  std::map<ObjectId, uint64_t> revision_, mesh_revision_;
  std::set<ObjectId> gone_;
};

}  // namespace romap::testing
