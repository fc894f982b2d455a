#include "server/store/session_transfer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "common/status.h"
#include "server/store/session_file.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::store::session_transfer_test {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class SessionTransferTest : public ::testing::Test {
 protected:
  void SetUp() override {
    Open();
    StoredSession session;
    session.id = "a";
    session.options.name = "kitchen";
    session.options.camera = testing_support::SmallCamera();
    session.created_unix_ns = 1'000;
    ASSERT_TRUE(store_->Create(session).ok());
    for (uint64_t id = 1; id <= 30; ++id) store_->AppendInput("a", testing_support::MakeFrame(id, "mug"), true);
    ObjectUpdate object;
    object.id = ObjectId{4};
    object.revision = 9;
    store_->PutObject("a", object);
    MeshUpdate mesh;
    mesh.id = ObjectId{4};
    mesh.draco = "mesh";
    store_->PutMesh("a", mesh);
    FrameAck ack;
    ack.T_world_camera.emplace();
    store_->PutTrajectory("a", {ack}, {77});
    store_->PutState("a", SessionState::kFinished, "", {.frames_received = 30});
    ASSERT_TRUE(store_->Flush().ok());
  }
  void Open() {
    store_ = nullptr;
    StoreConfig config;
    config.data_dir = folder_.path();
    config.commit_period_s = 0.005;
    store_ = Store::Open(config).value();
  }
  std::string Saved() {
    std::string file;
    EXPECT_TRUE(SaveSession(*store_, "a", [&](const std::string& piece) {
                  file += piece;
                  return absl::OkStatus();
                }).ok());
    return file;
  }
  // In pieces of `bytes`.
  absl::StatusOr<StoredSession> Load(const std::string& file, size_t bytes = 1000) {
    size_t begin = 0;
    return LoadSession(*store_, "b", "lab", [&]() -> absl::StatusOr<std::string> {
      const std::string piece = file.substr(std::min(begin, file.size()), bytes);
      begin += bytes;
      return piece;
    });
  }
  size_t FoldersOfSessions() const {
    const std::filesystem::directory_iterator folders(folder_ / "sessions");
    return static_cast<size_t>(std::distance(begin(folders), end(folders)));
  }

  testing_support::TemporaryFolder folder_;
  std::unique_ptr<Store> store_;
};

TEST_F(SessionTransferTest, ALoadedSessionEqualsTheSavedOne) {
  const std::string file = Saved();
  for (const size_t piece_bytes : {size_t{7}, size_t{100'000'000}}) {
    const auto loaded = Load(file, piece_bytes);
    ASSERT_TRUE(loaded.ok()) << Message(loaded.status());
    Open();
    const auto sessions = store_->Sessions().value();
    ASSERT_THAT(sessions, SizeIs(2));
    const StoredSession& copy = sessions[0].id == "b" ? sessions[0] : sessions[1];
    EXPECT_EQ(copy.options.name, "kitchen");
    EXPECT_EQ(copy.state, SessionState::kFinished);
    EXPECT_EQ(copy.created_unix_ns, 1'000);
    EXPECT_EQ(copy.inputs, 30u);
    EXPECT_EQ(copy.statistics.frames_received, 30u);
    for (uint64_t number = 1; number <= 30; ++number) {
      EXPECT_EQ(std::get<FrameInput>(store_->LoadInput("b", number).value()).frame_id, number);
    }
    const StoredMap map = store_->LoadMap("b").value();
    ASSERT_THAT(map.objects, SizeIs(1));
    EXPECT_EQ(map.objects[0].object.revision, 9u);
    EXPECT_EQ(map.objects[0].mesh->draco, "mesh");
    EXPECT_EQ(map.timestamps_ns, std::vector<int64_t>{77});
    ASSERT_TRUE(store_->Remove("b").ok());
  }
}

TEST_F(SessionTransferTest, NothingRemainsOfAFileThatIsCutOffOrDamaged) {
  const std::string file = Saved();
  for (const size_t length : {size_t{4}, size_t{20}, file.size() / 2, file.size() - 1}) {
    const auto loaded = Load(file.substr(0, length));
    EXPECT_EQ(loaded.status().code(), absl::StatusCode::kInvalidArgument) << length;
  }
  std::string damaged = file;
  damaged[file.size() / 2] ^= 1;
  EXPECT_THAT(Message(Load(damaged).status()), HasSubstr("damaged"));
  EXPECT_THAT(Message(Load("a picture").status()), HasSubstr("not a session file"));
  std::string newer = file;
  newer[8] = 2;
  EXPECT_THAT(Message(Load(newer).status()), HasSubstr("version 2"));
  EXPECT_THAT(Message(Load(file + "more").status()), HasSubstr("cut off"));
  EXPECT_THAT(store_->Sessions().value(), SizeIs(1));
  EXPECT_EQ(FoldersOfSessions(), 1u);
}

TEST_F(SessionTransferTest, AnErrorOfTheReaderIsReturned) {
  EXPECT_EQ(LoadSession(*store_, "b", "lab", [] { return absl::CancelledError("gone"); }).status().code(),
            absl::StatusCode::kCancelled);
}

TEST_F(SessionTransferTest, AHalfWrittenImportIsRemovedAtTheNextStart) {
  StoredSession half;
  half.id = "half";
  half.options.camera = testing_support::SmallCamera();
  half.complete = false;
  ASSERT_TRUE(store_->Create(half).ok());
  store_->AppendInput("half", testing_support::MakeFrame(1), true);
  ASSERT_TRUE(store_->Flush().ok());
  EXPECT_THAT(store_->Sessions().value(), SizeIs(1)) << "it is not listed before it is complete";
  EXPECT_EQ(FoldersOfSessions(), 2u);
  Open();
  EXPECT_THAT(store_->Sessions().value(), SizeIs(1));
  EXPECT_EQ(FoldersOfSessions(), 1u);
}

}  // namespace romap::store::session_transfer_test
