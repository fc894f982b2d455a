#include "server/session/outbox.h"

#include <gtest/gtest.h>

#include <thread>

namespace romap::session::outbox_test {

constexpr std::chrono::milliseconds kNoWait{0};

ObjectUpdate Update(uint64_t id, uint64_t revision) {
  ObjectUpdate update;
  update.id = ObjectId{id};
  update.revision = revision;
  return update;
}

MeshUpdate NewMesh(uint64_t id, uint64_t revision) {
  MeshUpdate mesh;
  mesh.id = ObjectId{id};
  mesh.revision = revision;
  return mesh;
}

FrameAck Ack(uint64_t frame_id) {
  FrameAck ack;
  ack.frame_id = frame_id;
  return ack;
}

TEST(OutboxTest, OnlyTheNewestRevisionWaitsBehindTheAnnouncement) {
  Outbox outbox(Outbox::Acks::kAll, 100);
  outbox.Put(Update(1, 1));
  outbox.Put(Update(1, 2));
  outbox.Put(NewMesh(1, 2));
  outbox.Put(Update(2, 1));
  outbox.Put(Update(1, 3));
  outbox.Put(NewMesh(1, 4));
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).revision, 1u);
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).id, ObjectId{2});
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).revision, 3u) << "revisions are read in order";
  EXPECT_EQ(std::get<MeshUpdate>(*outbox.Next(kNoWait)).revision, 4u);
  EXPECT_EQ(outbox.Next(kNoWait), std::nullopt);
  outbox.Put(Update(1, 5));
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).revision, 5u) << "an event that was read is not replaced";
}

TEST(OutboxTest, MeshStaysBehindTheAnnouncement) {
  Outbox outbox(Outbox::Acks::kAll, 100);
  outbox.Put(Update(1, 1));
  outbox.Put(NewMesh(1, 2));
  outbox.Put(Update(1, 3));
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).revision, 1u);
  EXPECT_EQ(std::get<MeshUpdate>(*outbox.Next(kNoWait)).revision, 2u);
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).revision, 3u);
}

TEST(OutboxTest, RemovalDropsTheWaitingEventsOfTheObject) {
  Outbox outbox(Outbox::Acks::kAll, 100);
  for (uint64_t id : {1, 2, 3}) outbox.Put(Update(id, 1));
  while (outbox.Next(kNoWait)) {
  }
  outbox.Put(Update(1, 2));
  outbox.Put(NewMesh(1, 3));
  outbox.Put(ObjectRemoved{ObjectId{1}, 4, "false landmark"});
  outbox.Put(Update(2, 2));
  outbox.Put(ObjectMerged{ObjectId{2}, ObjectId{3}, 9});
  EXPECT_TRUE(std::holds_alternative<ObjectRemoved>(*outbox.Next(kNoWait)));
  EXPECT_TRUE(std::holds_alternative<ObjectMerged>(*outbox.Next(kNoWait)));
  EXPECT_EQ(outbox.Next(kNoWait), std::nullopt);
}

TEST(OutboxTest, ObjectRemovedBeforeItsAnnouncementIsReadProducesNoEvent) {
  Outbox outbox(Outbox::Acks::kAll, 100);
  outbox.Put(Update(1, 1));
  outbox.Put(NewMesh(1, 2));
  outbox.Put(ObjectRemoved{ObjectId{1}, 3, "false landmark"});
  outbox.Put(Update(2, 1));
  outbox.Put(Update(3, 1));
  outbox.Put(ObjectMerged{ObjectId{3}, ObjectId{2}, 2});
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).id, ObjectId{2});
  EXPECT_EQ(outbox.Next(kNoWait), std::nullopt);
}

TEST(OutboxTest, MergeIntoAnUnreadObjectFollowsItsRemovalOrMerge) {
  for (const bool removed : {false, true}) {
    Outbox outbox(Outbox::Acks::kAll, 100);
    outbox.Put(Update(1, 5));
    EXPECT_TRUE(outbox.Next(kNoWait).has_value());  // only object 1 is read
    outbox.Put(Update(2, 1));
    outbox.Put(ObjectMerged{ObjectId{1}, ObjectId{2}, 2});
    if (removed) {
      outbox.Put(ObjectRemoved{ObjectId{2}, 3, "false landmark"});
      const auto end = std::get<ObjectRemoved>(*outbox.Next(kNoWait));
      EXPECT_EQ(end.id, ObjectId{1});
      EXPECT_EQ(end.revision, 6u);
    } else {
      outbox.Put(Update(3, 1));
      outbox.Put(ObjectMerged{ObjectId{2}, ObjectId{3}, 2});
      EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).id, ObjectId{3});
      const auto merged = std::get<ObjectMerged>(*outbox.Next(kNoWait));
      EXPECT_EQ(merged.from, ObjectId{1});
      EXPECT_EQ(merged.into, ObjectId{3});
    }
    EXPECT_EQ(outbox.Next(kNoWait), std::nullopt);
  }
}

TEST(OutboxTest, SenderGetsEveryAckAndViewerTheNewest) {
  Outbox sender(Outbox::Acks::kAll, 100), viewer(Outbox::Acks::kNewest, 1);
  for (uint64_t i = 1; i <= 3; ++i) {
    sender.Put(Ack(i));
    viewer.Put(Ack(i));
  }
  for (uint64_t i = 1; i <= 3; ++i) EXPECT_EQ(std::get<FrameAck>(*sender.Next(kNoWait)).frame_id, i);
  EXPECT_EQ(std::get<FrameAck>(*viewer.Next(kNoWait)).frame_id, 3u);
  EXPECT_EQ(viewer.Next(kNoWait), std::nullopt);
}

TEST(OutboxTest, OnlyTheSenderGetsMasksAcks) {
  Outbox sender(Outbox::Acks::kAll, 2), viewer(Outbox::Acks::kNewest, 1);
  sender.Put(Ack(1));
  for (Outbox* outbox : {&sender, &viewer}) {
    for (uint64_t i = 1; i <= 2; ++i) outbox->Put(MasksAck{.frame_id = i, .accepted = true, .error = ""});
  }
  for (uint64_t i = 1; i <= 2; ++i) EXPECT_EQ(std::get<MasksAck>(*sender.Next(kNoWait)).frame_id, i) << "max_acks is 2";
  EXPECT_EQ(sender.Next(kNoWait), std::nullopt);
  EXPECT_EQ(viewer.Next(kNoWait), std::nullopt);
}

TEST(OutboxTest, TheOldestAcksOfASlowReaderAreDropped) {
  Outbox outbox(Outbox::Acks::kAll, 4);
  outbox.Put(Update(1, 1));
  for (uint64_t i = 1; i <= 100; ++i) outbox.Put(Ack(i));
  EXPECT_TRUE(std::holds_alternative<ObjectUpdate>(*outbox.Next(kNoWait)));
  for (uint64_t i = 97; i <= 100; ++i) EXPECT_EQ(std::get<FrameAck>(*outbox.Next(kNoWait)).frame_id, i);
  EXPECT_EQ(outbox.Next(kNoWait), std::nullopt);
}

TEST(OutboxTest, ClosedOutboxKeepsWaitingEventsAndItsStatus) {
  Outbox outbox(Outbox::Acks::kAll, 4);
  outbox.Put(Ack(1));
  outbox.Close(absl::NotFoundError("deleted"));
  outbox.Close(absl::OkStatus());
  outbox.Put(Ack(2));
  EXPECT_FALSE(outbox.Done());
  EXPECT_TRUE(outbox.Next(kNoWait).has_value());
  EXPECT_TRUE(outbox.Done());
  EXPECT_EQ(outbox.status().code(), absl::StatusCode::kNotFound);
}

TEST(OutboxTest, CloseEndsABlockedNext) {
  Outbox outbox(Outbox::Acks::kAll, 4);
  std::thread reader([&] { EXPECT_EQ(outbox.Next(std::chrono::minutes(1)), std::nullopt); });
  outbox.Close();
  reader.join();
}

}  // namespace romap::session::outbox_test
