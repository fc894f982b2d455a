// Compares copies of the map, built from the events of an outbox, with the map itself after random changes.

#include <gmock/gmock.h>

#include "server/session/map_state.h"
#include "tests/support/checked_copy.h"
#include "tests/support/random_map.h"

namespace romap::session::copied_map_test {

using testing_support::CheckedCopy;
using testing_support::RandomMap;

constexpr std::chrono::milliseconds kNoWait{0};
constexpr uint64_t kSeeds = 100;
constexpr int kSteps = 400;

// A subscriber that reads a few events in `share` of 10 calls of MaybeRead().
class Reader {
 public:
  Reader(MapState& map, Outbox::Acks acks, int share) : outbox_(map.Subscribe(acks, 50)), share_(share) {}

  void MaybeRead(testing_support::RandomMap& random) {
    if (random.Pick(0, 9) >= share_) return;
    for (int n = random.Pick(1, 12); n > 0; --n) ReadOne();
  }
  // Reads all waiting events; returns how many of them are about objects.
  int ReadToEnd() {
    int of_objects = 0;
    while (const auto event = ReadOne()) {
      const bool is_other = std::holds_alternative<FrameAck>(*event) || std::holds_alternative<MasksAck>(*event) ||
                            std::holds_alternative<Statistics>(*event);
      of_objects += is_other ? 0 : 1;
    }
    return of_objects;
  }
  const testing_support::CheckedCopy& copy() const { return copy_; }

 private:
  std::optional<MapEvent> ReadOne() {
    std::optional<MapEvent> event = outbox_->Next(kNoWait);
    if (event) copy_.Apply(*event);
    return event;
  }

  testing_support::CheckedCopy copy_;
  std::shared_ptr<Outbox> outbox_;
  int share_;
};

std::map<ObjectId, std::string> TruthOf(MapState& map) {
  Reader reader(map, Outbox::Acks::kAll, 0);
  reader.ReadToEnd();
  return reader.copy().Bytes();
}

TEST(CopiedMapTest, EqualsTheMapForFastAndSlowReaders) {
  for (uint64_t seed = 0; seed < kSeeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    MapState map;
    testing_support::RandomMap random(seed, &map);
    std::vector<Reader> readers;
    for (const int share : {10, 5, 1}) readers.emplace_back(map, Outbox::Acks::kAll, share);
    for (int step = 0; step < kSteps; ++step) {
      if (step == kSteps / 3) readers.emplace_back(map, Outbox::Acks::kNewest, 2);  // subscribes late
      random.Step();
      for (Reader& reader : readers) reader.MaybeRead(random);
    }
    for (Reader& reader : readers) {
      reader.ReadToEnd();
      EXPECT_EQ(reader.copy().Bytes(), TruthOf(map));
    }
  }
}

TEST(CopiedMapTest, SnapshotIsTheMapWithoutProvisionalObjects) {
  size_t exported = 0, all = 0;
  for (uint64_t seed = 0; seed < kSeeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    MapState map;
    testing_support::RandomMap random(seed, &map);
    for (int step = 0; step < kSteps; ++step) random.Step();
    const std::vector<ObjectSnapshot> objects = map.Snapshot().objects;
    const auto truth = TruthOf(map);
    for (const ObjectSnapshot& object : objects) {
      EXPECT_NE(object.object.state, ObjectState::kProvisional);
      EXPECT_EQ(testing_support::CheckedCopy::ToBytes(object), truth.at(object.object.id));
    }
    EXPECT_EQ(objects.size(), map.ConfirmedObjects());
    exported += objects.size();
    all += truth.size();
  }
  EXPECT_GT(exported, 0u);
  EXPECT_LT(exported, all);
}

TEST(CopiedMapTest, WaitingEventsOfAReaderThatNeverReadsAreBounded) {
  for (uint64_t seed = 0; seed < kSeeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    MapState map;
    testing_support::RandomMap random(seed, &map);
    Reader idle(map, Outbox::Acks::kAll, 0);
    for (int step = 0; step < kSteps; ++step) random.Step();
    const auto truth = TruthOf(map);
    EXPECT_LE(idle.ReadToEnd(), 3 * static_cast<int>(truth.size())) << "announcement, cuboid and mesh of each object";
    EXPECT_EQ(idle.copy().Bytes(), truth);
  }
}

}  // namespace romap::session::copied_map_test
