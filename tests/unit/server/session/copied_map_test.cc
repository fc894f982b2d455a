// A client's copy of the map against the map itself, over everything that can happen to one.

#include <gmock/gmock.h>

#include "server/session/map_state.h"
#include "tests/support/checked_copy.h"
#include "tests/support/random_map.h"

namespace romap {
namespace {

using testing::CheckedCopy;
using testing::RandomMap;

constexpr std::chrono::milliseconds kNoWait{0};
constexpr int kSteps = 400;

// A subscriber that takes `share` of 10 chances to read a few events.
class Reader {
 public:
  Reader(MapState& map, Outbox::Acks acks, int share) : outbox_(map.Subscribe(acks, 50, true)), share_(share) {}

  void MaybeRead(RandomMap& random) {
    if (random.Pick(0, 9) >= share_) return;
    for (int n = random.Pick(1, 12); n > 0; --n) Take();
  }
  // What still waits; how many events of objects that was.
  int ReadToEnd() {
    int of_objects = 0;
    while (const auto event = Take()) {
      const bool is_other = std::holds_alternative<FrameAck>(*event) || std::holds_alternative<MasksAck>(*event) ||
                            std::holds_alternative<Statistics>(*event);
      of_objects += is_other ? 0 : 1;
    }
    return of_objects;
  }
  const CheckedCopy& copy() const { return copy_; }

 private:
  std::optional<MapEvent> Take() {
    std::optional<MapEvent> event = outbox_->Next(kNoWait);
    if (event) copy_.Apply(*event);
    return event;
  }

  CheckedCopy copy_;
  std::shared_ptr<Outbox> outbox_;
  int share_;
};

std::map<ObjectId, std::string> TruthOf(MapState& map) {
  Reader newcomer(map, Outbox::Acks::kAll, 0);
  newcomer.ReadToEnd();
  return newcomer.copy().Bytes();
}

class CopiedMapTest : public ::testing::TestWithParam<uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Seeds, CopiedMapTest, ::testing::Range<uint64_t>(0, 150));

TEST_P(CopiedMapTest, IsTheMapHoweverSlowlyItIsRead) {
  MapState map;
  RandomMap random(GetParam(), &map);
  std::vector<Reader> readers;
  for (const int share : {10, 5, 1}) readers.emplace_back(map, Outbox::Acks::kAll, share);
  for (int step = 0; step < kSteps && !HasFailure(); ++step) {
    if (step == kSteps / 3) readers.emplace_back(map, Outbox::Acks::kNewest, 2);  // in the middle of it all
    random.Step();
    for (Reader& reader : readers) reader.MaybeRead(random);
  }
  for (Reader& reader : readers) {
    reader.ReadToEnd();
    ASSERT_EQ(reader.copy().Bytes(), TruthOf(map));
  }
}

TEST_P(CopiedMapTest, WhatIsExportedIsTheCopyWithoutProvisionalObjects) {
  MapState map;
  RandomMap random(GetParam(), &map);
  for (int step = 0; step < kSteps; ++step) random.Step();
  std::map<ObjectId, std::string> exported;
  for (const ObjectSnapshot& object : map.Snapshot().objects) {
    EXPECT_NE(object.object.state, ObjectState::kProvisional);
    exported[object.object.id] = CheckedCopy::ToBytes(object);
  }
  const auto truth = TruthOf(map);
  EXPECT_LE(exported.size(), truth.size());
  EXPECT_EQ(exported.size(), map.ConfirmedObjects());
  for (const auto& [id, bytes] : exported) EXPECT_EQ(bytes, truth.at(id));
}

TEST_P(CopiedMapTest, WhatWaitsForOneWhoNeverReadsIsBoundedByTheMap) {
  MapState map;
  RandomMap random(GetParam(), &map);
  Reader sleeper(map, Outbox::Acks::kAll, 0);
  for (int step = 0; step < kSteps; ++step) random.Step();
  const size_t live = TruthOf(map).size();
  EXPECT_LE(sleeper.ReadToEnd(), 3 * static_cast<int>(live)) << "an announcement, a cuboid and a mesh of each";
  EXPECT_EQ(sleeper.copy().Bytes(), TruthOf(map));
}

}  // namespace
}  // namespace romap
