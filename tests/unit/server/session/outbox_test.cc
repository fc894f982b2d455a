#include "server/session/outbox.h"

#include <gtest/gtest.h>

#include <thread>

namespace romap {
namespace {

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

TEST(OutboxTest, OnlyTheNewestRevisionOfAnObjectWaits) {
  Outbox outbox(Outbox::Acks::kAll, 100);
  outbox.Put(Update(1, 1));
  outbox.Put(NewMesh(1, 2));
  outbox.Put(Update(2, 1));
  outbox.Put(Update(1, 3));
  outbox.Put(NewMesh(1, 4));
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).id, ObjectId{2});
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).revision, 3u) << "revisions come in their order";
  EXPECT_EQ(std::get<MeshUpdate>(*outbox.Next(kNoWait)).revision, 4u);
  EXPECT_EQ(outbox.Next(kNoWait), std::nullopt);
  outbox.Put(Update(1, 5));
  EXPECT_EQ(std::get<ObjectUpdate>(*outbox.Next(kNoWait)).revision, 5u) << "what was taken no longer coalesces";
}

TEST(OutboxTest, WhatWaitsOfAGoneObjectIsForgotten) {
  Outbox outbox(Outbox::Acks::kAll, 100);
  outbox.Put(Update(1, 1));
  outbox.Put(NewMesh(1, 2));
  outbox.Put(ObjectRemoved{ObjectId{1}, 3, "ghost"});
  outbox.Put(Update(2, 1));
  outbox.Put(ObjectMerged{ObjectId{2}, ObjectId{3}, 9});
  EXPECT_TRUE(std::holds_alternative<ObjectRemoved>(*outbox.Next(kNoWait)));
  EXPECT_TRUE(std::holds_alternative<ObjectMerged>(*outbox.Next(kNoWait)));
  EXPECT_EQ(outbox.Next(kNoWait), std::nullopt);
}

TEST(OutboxTest, TheSenderGetsEveryAckAndAViewerTheNewest) {
  Outbox sender(Outbox::Acks::kAll, 100), viewer(Outbox::Acks::kNewest, 1);
  for (uint64_t i = 1; i <= 3; ++i) {
    sender.Put(Ack(i));
    viewer.Put(Ack(i));
  }
  for (uint64_t i = 1; i <= 3; ++i) EXPECT_EQ(std::get<FrameAck>(*sender.Next(kNoWait)).frame_id, i);
  EXPECT_EQ(std::get<FrameAck>(*viewer.Next(kNoWait)).frame_id, 3u);
  EXPECT_EQ(viewer.Next(kNoWait), std::nullopt);
}

TEST(OutboxTest, AReaderThatSleepsCostsBoundedMemory) {
  Outbox outbox(Outbox::Acks::kAll, 4);
  outbox.Put(Update(1, 1));
  for (uint64_t i = 1; i <= 100; ++i) outbox.Put(Ack(i));
  EXPECT_TRUE(std::holds_alternative<ObjectUpdate>(*outbox.Next(kNoWait)));
  for (uint64_t i = 97; i <= 100; ++i) EXPECT_EQ(std::get<FrameAck>(*outbox.Next(kNoWait)).frame_id, i);
  EXPECT_EQ(outbox.Next(kNoWait), std::nullopt);
}

TEST(OutboxTest, ClosesWithAStatusAndDrains) {
  Outbox outbox(Outbox::Acks::kAll, 4);
  outbox.Put(Ack(1));
  outbox.Close(absl::NotFoundError("gone"));
  outbox.Close(absl::OkStatus());
  outbox.Put(Ack(2));
  EXPECT_FALSE(outbox.Done());
  EXPECT_TRUE(outbox.Next(kNoWait).has_value());
  EXPECT_TRUE(outbox.Done());
  EXPECT_EQ(outbox.status().code(), absl::StatusCode::kNotFound);
}

TEST(OutboxTest, CloseWakesAWaitingReader) {
  Outbox outbox(Outbox::Acks::kAll, 4);
  std::thread reader([&] { EXPECT_EQ(outbox.Next(std::chrono::minutes(1)), std::nullopt); });
  outbox.Close();
  reader.join();
}

}  // namespace
}  // namespace romap
