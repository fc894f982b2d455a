#pragma once

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

#include "client/sdk/map_copy.h"
#include "common/wire/events.h"

namespace romap::testing_support {

// A client's copy of a map that checks the guarantees of an event stream: no event of an object precedes its first
// update or follows its removal or merge, and revisions increase.
class CheckedCopy {
 public:
  void Apply(const MapEvent& event) {
    if (const auto* update = std::get_if<ObjectUpdate>(&event)) {
      EXPECT_FALSE(ended_.contains(update->id)) << update->id << " has an update after its removal or merge";
      EXPECT_GT(update->revision, revision_[update->id]) << update->id;
      revision_[update->id] = update->revision;
    } else if (const auto* mesh = std::get_if<MeshUpdate>(&event)) {
      ExpectKnown(mesh->id, "mesh");
      EXPECT_GT(mesh->revision, mesh_revision_[mesh->id]) << mesh->id;
      mesh_revision_[mesh->id] = mesh->revision;
    } else if (const auto* removed = std::get_if<ObjectRemoved>(&event)) {
      ExpectKnown(removed->id, "removal");
      EXPECT_GT(removed->revision, revision_[removed->id]) << removed->id;
      ended_.insert(removed->id);
    } else if (const auto* merged = std::get_if<ObjectMerged>(&event)) {
      ExpectKnown(merged->from, "merge from");
      ExpectKnown(merged->into, "merge into");
      // Two merges into the same object may have the same revision.
      EXPECT_GE(merged->revision, revision_[merged->into]) << merged->into;
      revision_[merged->into] = merged->revision;
      ended_.insert(merged->from);
    }
    copy_.Apply(event);
  }

  // All fields of every object as text, by id.
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
    EXPECT_TRUE(copy_.objects().contains(id)) << what << ": " << id << " was not announced";
  }

  client::MapCopy copy_;
  std::map<ObjectId, uint64_t> revision_, mesh_revision_;
  std::set<ObjectId> ended_;
};

}  // namespace romap::testing_support
