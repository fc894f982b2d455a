#include "server/store/store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>

#include "common/status.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::store::store_test {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

ObjectUpdate MakeObject(uint64_t id, uint64_t revision) {
  ObjectUpdate object;
  object.id = ObjectId{id};
  object.revision = revision;
  object.state = ObjectState::kConfirmed;
  object.class_name = "mug";
  object.cuboid.half_extents = Eigen::Vector3d(0.1, 0.2, 0.3);
  return object;
}

MeshUpdate MakeMesh(uint64_t id, const std::string& draco) {
  MeshUpdate mesh;
  mesh.id = ObjectId{id};
  mesh.revision = 3;
  mesh.steps = 700;
  mesh.draco = draco;
  return mesh;
}

class StoreTest : public ::testing::Test {
 protected:
  StoreConfig Config() const {
    StoreConfig config;
    config.data_dir = folder_.path();
    config.commit_period_s = 0.005;
    return config;
  }
  std::unique_ptr<Store> OpenStore() const {
    auto store = Store::Open(Config());
    EXPECT_TRUE(store.ok()) << Message(store.status());
    return store.ok() ? *std::move(store) : nullptr;
  }
  static StoredSession MakeSession(const std::string& id) {
    StoredSession session;
    session.id = id;
    session.options.name = "kitchen";
    session.options.camera = testing_support::SmallCamera();
    session.created_unix_ns = session.used_unix_ns = 1'000;
    return session;
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(StoreTest, TheBacklogIsWhatIsNotDurableYet) {
  StoreConfig config = Config();
  config.commit_period_s = 30;  // Flush() does not wait for it
  const auto store = Store::Open(config).value();
  ASSERT_TRUE(store->Create(MakeSession("a")).ok());
  const FrameInput frame = testing_support::MakeFrame(5, "mug");
  store->AppendInput("a", frame, true);
  EXPECT_GE(store->GetBacklog().bytes, frame.image.size());
  EXPECT_GT(store->GetBacklog().oldest_wait_s, 0);
  EXPECT_OK(store->Flush());
  // The promise of Flush() is fulfilled a moment before the batch has ended.
  EXPECT_TRUE(testing_support::Eventually([&] { return store->GetBacklog().bytes == 0; }));
  EXPECT_EQ(store->GetBacklog().oldest_wait_s, 0);
}

TEST_F(StoreTest, EverythingIsThereAfterReopening) {
  {
    const auto store = OpenStore();
    ASSERT_TRUE(store->Create(MakeSession("a")).ok());
    store->AppendInput("a", testing_support::MakeFrame(5, "mug"), true);
    MasksInput masks;
    masks.frame_id = 5;
    masks.mask_encoding = MaskEncoding::kRunLength;
    masks.label_runs = {0, 64 * 48};
    store->AppendInput("a", masks, true);
    store->AppendInput("a", testing_support::MakeFrame(9), true);
    store->PutObject("a", MakeObject(1, 1));
    store->PutObject("a", MakeObject(2, 1));
    store->PutObject("a", MakeObject(3, 1));
    store->PutMesh("a", MakeMesh(1, "first"));
    store->PutMesh("a", MakeMesh(1, "second"));
    store->PutObject("a", MakeObject(1, 4));
    store->RemoveObject("a", ObjectId{3});
    FrameAck ack;
    ack.frame_id = 5;
    ack.T_world_camera.emplace(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 2, 3));
    store->PutTrajectory("a", {ack}, {77});
    store->PutState("a", SessionState::kFinishing, "", {.frames_received = 2});
    store->SetPinned("a", true);
  }
  const auto store = OpenStore();
  const std::vector<StoredSession> sessions = store->Sessions().value();
  ASSERT_THAT(sessions, SizeIs(1));
  EXPECT_EQ(sessions[0].id, "a");
  EXPECT_EQ(sessions[0].options.name, "kitchen");
  EXPECT_EQ(sessions[0].options.camera.width_px, 64);
  EXPECT_EQ(sessions[0].state, SessionState::kFinishing);
  EXPECT_EQ(sessions[0].statistics.frames_received, 2u);
  EXPECT_EQ(sessions[0].inputs, 3u);
  EXPECT_TRUE(sessions[0].pinned);
  EXPECT_GT(sessions[0].used_unix_ns, 1'000);
  EXPECT_EQ(std::get<FrameInput>(store->LoadInput("a", 1).value()).instances.at(0).class_name, "mug");
  EXPECT_EQ(std::get<MasksInput>(store->LoadInput("a", 2).value()).frame_id, 5u);
  EXPECT_EQ(std::get<FrameInput>(store->LoadInput("a", 3).value()).frame_id, 9u);
  EXPECT_EQ(store->LoadInput("a", 4).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store->DurableInputs("a").frame_id, 9u);
  EXPECT_EQ(store->DurableInputs("a").masks_frame_id, 5u);
  const StoredMap map = store->LoadMap("a").value();
  EXPECT_THAT(map.damage, IsEmpty());
  EXPECT_EQ(map.last_object, ObjectId{3});
  ASSERT_THAT(map.objects, SizeIs(2));
  EXPECT_EQ(map.objects[0].object.revision, 4u);
  EXPECT_EQ(map.objects[0].mesh->draco, "second");
  EXPECT_FALSE(map.objects[1].mesh.has_value());
  ASSERT_THAT(map.trajectory, SizeIs(1));
  EXPECT_EQ(map.trajectory[0].T_world_camera->translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(map.timestamps_ns, std::vector<int64_t>{77});
  // Inputs go on with the next number.
  store->AppendInput("a", testing_support::MakeFrame(10), true);
  ASSERT_TRUE(store->Flush().ok());
  EXPECT_EQ(std::get<FrameInput>(store->LoadInput("a", 4).value()).frame_id, 10u);
}

TEST_F(StoreTest, TheListenerHearsWhatIsDurable) {
  const auto store = OpenStore();
  ASSERT_TRUE(store->Create(MakeSession("a")).ok());
  std::mutex mutex;
  std::vector<uint64_t> durable;
  store->SetListener("a", {.durable =
                               [&](const Durable& d) {
                                 std::lock_guard lock(mutex);
                                 durable.push_back(d.frame_id);
                               },
                           .trouble = [](const absl::Status&) {}});
  for (uint64_t id = 1; id <= 20; ++id) {
    store->AppendInput("a", testing_support::MakeFrame(id), true);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  ASSERT_TRUE(store->Flush().ok());
  store->RemoveListener("a");
  std::lock_guard lock(mutex);
  ASSERT_FALSE(durable.empty());
  EXPECT_TRUE(std::is_sorted(durable.begin(), durable.end()));
  EXPECT_EQ(durable.back(), 20u);
}

// The child is killed while it writes. What it heard to be durable must be there.
TEST_F(StoreTest, WhatIsDurableSurvivesAKill) {
  for (int round = 0; round < 3; ++round) {
    int pipe_fds[2];
    ASSERT_EQ(pipe(pipe_fds), 0);
    const pid_t child = fork();
    if (child == 0) {
      auto store = Store::Open(Config());
      if (!store.ok() || (round == 0 && !(*store)->Create(MakeSession("a")).ok())) _exit(1);
      (*store)->SetListener("a", {.durable =
                                      [&](const Durable& d) {
                                        if (write(pipe_fds[1], &d.frame_id, sizeof(d.frame_id)) < 0) _exit(1);
                                      },
                                  .trouble = [](const absl::Status&) {}});
      uint64_t id = (*store)->DurableInputs("a").frame_id;
      while (true) {
        (*store)->AppendInput("a", testing_support::MakeFrame(++id), true);
        std::this_thread::sleep_for(std::chrono::microseconds(500));
      }
    }
    uint64_t durable = 0;
    for (int i = 0; i < 5 + 7 * round; ++i) {
      ASSERT_EQ(read(pipe_fds[0], &durable, sizeof(durable)), static_cast<ssize_t>(sizeof(durable)));
    }
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    close(pipe_fds[1]);
    for (uint64_t later = 0; read(pipe_fds[0], &later, sizeof(later)) == static_cast<ssize_t>(sizeof(later));) {
      durable = later;
    }
    close(pipe_fds[0]);
    const auto store = OpenStore();
    const uint64_t stored = store->Sessions().value().at(0).inputs;
    EXPECT_GE(stored, durable);
    for (uint64_t number = 1; number <= stored; ++number) {
      const auto input = store->LoadInput("a", number);
      ASSERT_TRUE(input.ok()) << number << ": " << Message(input.status());
      ASSERT_EQ(std::get<FrameInput>(*input).frame_id, number);
    }
  }
}

TEST_F(StoreTest, CompactionGivesBackTheSpaceOfOldMeshes) {
  auto store = OpenStore();
  ASSERT_TRUE(store->Create(MakeSession("a")).ok());
  for (uint64_t id = 1; id <= 10; ++id) store->AppendInput("a", testing_support::MakeFrame(id), true);
  store->PutObject("a", MakeObject(1, 1));
  for (int version = 1; version <= 20; ++version) {
    store->PutMesh("a", MakeMesh(1, std::string(10'000, static_cast<char>('a' + version))));
  }
  ASSERT_TRUE(store->Flush().ok());
  EXPECT_GT(store->BytesOf("a"), 200'000u);
  ASSERT_TRUE(store->Compact("a").ok());
  EXPECT_LT(store->BytesOf("a"), 60'000u);
  store->AppendInput("a", testing_support::MakeFrame(11), true);
  ASSERT_TRUE(store->Flush().ok());
  for (int reopened = 0; reopened < 2; ++reopened) {
    for (uint64_t id = 1; id <= 11; ++id) {
      EXPECT_EQ(std::get<FrameInput>(store->LoadInput("a", id).value()).frame_id, id);
    }
    EXPECT_EQ(store->LoadMap("a")->objects.at(0).mesh->draco, std::string(10'000, 'a' + 20));
    store = nullptr;
    store = OpenStore();
  }
  const uint64_t before = store->BytesOf("a");
  ASSERT_TRUE(store->Compact("a").ok());
  EXPECT_EQ(store->BytesOf("a"), before) << "there is little to gain";
}

TEST_F(StoreTest, AMapCanBeReadDuringCompactions) {
  const auto store = OpenStore();
  ASSERT_TRUE(store->Create(MakeSession("a")).ok());
  for (uint64_t id = 1; id <= 50; ++id) {
    store->PutObject("a", MakeObject(id, 1));
    store->PutMesh("a", MakeMesh(id, std::string(5'000, 'm')));
  }
  ASSERT_TRUE(store->Flush().ok());
  std::atomic<bool> compacting = true;
  std::thread compactor([&] {
    for (int round = 0; round < 20; ++round) {
      for (uint64_t id = 1; id <= 10; ++id) store->PutMesh("a", MakeMesh(id, std::string(5'000, 'n')));
      EXPECT_TRUE(store->Flush().ok());
      EXPECT_TRUE(store->Compact("a").ok());
    }
    compacting = false;
  });
  while (compacting) {
    const StoredMap map = store->LoadMap("a").value();
    EXPECT_THAT(map.damage, IsEmpty());
    EXPECT_THAT(map.objects, SizeIs(50));
  }
  compactor.join();
}

// A kill during a compaction leaves the new segments before its commit, and the old ones after it.
TEST_F(StoreTest, SegmentsThatNothingRefersToAreSwept) {
  for (const bool is_committed : {false, true}) {
    const std::string session = is_committed ? "b" : "a";
    const std::string used = folder_ / ("sessions/" + session + (is_committed ? "/000001.seg" : "/000000.seg"));
    const std::string unused = folder_ / ("sessions/" + session + (is_committed ? "/000000.seg" : "/000001.seg"));
    {
      const auto store = OpenStore();
      ASSERT_TRUE(store->Create(MakeSession(session)).ok());
      store->AppendInput(session, testing_support::MakeFrame(1), true);
      store->PutObject(session, MakeObject(1, 1));
      for (int version = 1; version <= 5; ++version) store->PutMesh(session, MakeMesh(1, std::string(10'000, 'm')));
      ASSERT_TRUE(store->Flush().ok());
      if (is_committed) {
        ASSERT_TRUE(store->Compact(session).ok());
      }
    }
    std::filesystem::copy_file(used, unused);
    const auto store = OpenStore();
    EXPECT_TRUE(std::filesystem::exists(used));
    EXPECT_FALSE(std::filesystem::exists(unused));
    EXPECT_TRUE(store->LoadInput(session, 1).ok());
    EXPECT_TRUE(store->LoadMap(session)->objects.at(0).mesh.has_value());
  }
}

TEST_F(StoreTest, ADamagedSessionIsNotCompacted) {
  const auto store = OpenStore();
  ASSERT_TRUE(store->Create(MakeSession("a")).ok());
  store->AppendInput("a", testing_support::MakeFrame(1), true);
  store->PutObject("a", MakeObject(1, 1));
  for (int version = 1; version <= 5; ++version) store->PutMesh("a", MakeMesh(1, std::string(10'000, 'm')));
  ASSERT_TRUE(store->Flush().ok());
  {
    std::fstream file((folder_ / "sessions/a/000000.seg"), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(100);
    file.put('?');
  }
  EXPECT_EQ(store->Compact("a").code(), absl::StatusCode::kDataLoss);
  EXPECT_TRUE(store->LoadMap("a")->objects.at(0).mesh.has_value());
  EXPECT_TRUE(std::filesystem::exists(folder_ / "sessions/a/000000.seg"));
}

TEST_F(StoreTest, ANewDataFolderIsPrivate) {
  StoreConfig config = Config();
  config.data_dir = folder_ / "new/data";
  ASSERT_TRUE(Store::Open(config).ok());
  EXPECT_EQ(std::filesystem::status(config.data_dir).permissions(), std::filesystem::perms::owner_all);
}

TEST_F(StoreTest, ASecondProcessIsRefusedWithTheIdOfTheFirst) {
  const auto store = OpenStore();
  const auto second = Store::Open(Config());
  EXPECT_EQ(second.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(Message(second.status()), HasSubstr("is used by process " + std::to_string(getpid())));
}

TEST_F(StoreTest, ANewerSchemaIsRefusedAndNotChanged) {
  { const auto store = OpenStore(); }
  {
    SQLite::Database database((folder_ / "catalog.sqlite"), SQLite::OPEN_READWRITE);
    database.exec("PRAGMA user_version = 99");
  }
  const auto refused = Store::Open(Config());
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(Message(refused.status()), HasSubstr("has schema 99"));
  SQLite::Database database((folder_ / "catalog.sqlite"), SQLite::OPEN_READONLY);
  EXPECT_EQ(database.execAndGet("PRAGMA user_version").getInt(), 99);
}

TEST_F(StoreTest, ADamagedCatalogIsRefused) {
  { const auto store = OpenStore(); }
  std::filesystem::remove((folder_ / "catalog.sqlite-wal"));
  std::ofstream((folder_ / "catalog.sqlite"), std::ios::binary | std::ios::trunc) << std::string(8192, 'x');
  EXPECT_EQ(Store::Open(Config()).status().code(), absl::StatusCode::kDataLoss);
}

TEST_F(StoreTest, RemovedSessionsLeaveNoFiles) {
  const auto store = OpenStore();
  ASSERT_TRUE(store->Create(MakeSession("a")).ok());
  ASSERT_TRUE(store->Create(MakeSession("b")).ok());
  for (const char* session : {"a", "b"}) store->AppendInput(session, testing_support::MakeFrame(1), true);
  ASSERT_TRUE(store->Flush().ok());
  EXPECT_GT(store->BytesOf("a"), 3000u);
  ASSERT_TRUE(store->Remove("a").ok());
  store->AppendInput("a", testing_support::MakeFrame(2), true);  // late: ignored
  ASSERT_TRUE(store->Flush().ok());
  EXPECT_FALSE(std::filesystem::exists((folder_ / "sessions/a")));
  EXPECT_THAT(store->Sessions().value(), SizeIs(1));
  EXPECT_TRUE(store->LoadInput("b", 1).ok());
}

TEST_F(StoreTest, FilesOfUnknownSessionsAreSwept) {
  std::filesystem::create_directories((folder_ / "sessions/half"));
  std::ofstream((folder_ / "sessions/half/000000.seg")).put('x');
  const auto store = OpenStore();
  EXPECT_FALSE(std::filesystem::exists((folder_ / "sessions/half")));
}

TEST_F(StoreTest, DamagedPartsAreNamedAndTheRestIsRead) {
  {
    const auto store = OpenStore();
    ASSERT_TRUE(store->Create(MakeSession("a")).ok());
    for (uint64_t id : {1, 2}) store->PutObject("a", MakeObject(id, 1));
    store->PutMesh("a", MakeMesh(1, std::string(5000, 'm')));
    store->PutMesh("a", MakeMesh(2, std::string(5000, 'm')));
  }
  {
    std::fstream file((folder_ / "sessions/a/000000.seg"), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(2000);
    file.put('?');
  }
  const StoredMap map = OpenStore()->LoadMap("a").value();
  ASSERT_THAT(map.objects, SizeIs(2));
  EXPECT_FALSE(map.objects[0].mesh.has_value());
  EXPECT_TRUE(map.objects[1].mesh.has_value());
  ASSERT_THAT(map.damage, SizeIs(1));
  EXPECT_THAT(map.damage[0], HasSubstr("mesh of object/1"));
}

// The limit of the file size makes writes fail as a full disk does.
class LimitedFileSize {
 public:
  explicit LimitedFileSize(rlim_t bytes) {
    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~LimitedFileSize() { setrlimit(RLIMIT_FSIZE, &before_); }

 private:
  rlimit before_{};
};

// What the listener of a session heard.
class Heard {
 public:
  Heard(Store& store, const std::string& session) : store_(store), session_(session) {
    store_.SetListener(session_, {.durable =
                                      [this](const Durable& durable) {
                                        std::lock_guard lock(mutex_);
                                        durable_ = durable.frame_id;
                                      },
                                  .trouble =
                                      [this](const absl::Status& status) {
                                        std::lock_guard lock(mutex_);
                                        troubles_.push_back(status);
                                      }});
  }
  ~Heard() { store_.RemoveListener(session_); }

  std::vector<absl::Status> troubles() const {
    std::lock_guard lock(mutex_);
    return troubles_;
  }
  uint64_t durable() const {
    std::lock_guard lock(mutex_);
    return durable_;
  }

 private:
  Store& store_;
  const std::string session_;
  mutable std::mutex mutex_;
  std::vector<absl::Status> troubles_;
  uint64_t durable_ = 0;
};

TEST_F(StoreTest, AFullDiskIsSaidAndWritesAreTriedAgain) {
  const auto store = OpenStore();
  ASSERT_TRUE(store->Create(MakeSession("a")).ok());
  Heard heard(*store, "a");
  {
    LimitedFileSize full(10'000);
    for (uint64_t id = 1; id <= 20; ++id) store->AppendInput("a", testing_support::MakeFrame(id), true);
    ASSERT_TRUE(testing_support::Eventually([&] { return heard.troubles().size() == 1; }));
    EXPECT_FALSE(store->AcceptsChanges());
    EXPECT_FALSE(store->Create(MakeSession("b")).ok());
  }
  ASSERT_TRUE(testing_support::Eventually([&] { return heard.troubles().size() == 2; }));
  ASSERT_TRUE(store->Flush().ok());
  EXPECT_TRUE(store->AcceptsChanges());
  EXPECT_FALSE(heard.troubles()[0].ok());
  EXPECT_TRUE(heard.troubles()[1].ok());
  EXPECT_EQ(heard.durable(), 20u);
  for (uint64_t id = 1; id <= 20; ++id) EXPECT_TRUE(store->LoadInput("a", id).ok()) << id;
}

TEST_F(StoreTest, InputsThatDoNotFitAreReportedAndNothingLaterCountsAsDurable) {
  StoreConfig config = Config();
  config.max_waiting_mib = 1;
  const auto store = Store::Open(config).value();
  ASSERT_TRUE(store->Create(MakeSession("a")).ok());
  Heard heard(*store, "a");
  FrameInput large = testing_support::MakeFrame(1);
  large.image.assign(400'000, 'x');
  {
    LimitedFileSize full(10'000);
    for (uint64_t id = 1; id <= 10; ++id) {
      large.frame_id = id;
      store->AppendInput("a", large, /*may_wait=*/false);
    }
    ASSERT_TRUE(testing_support::Eventually([&] { return !heard.troubles().empty(); }));
  }
  ASSERT_TRUE(testing_support::Eventually([&] { return heard.troubles().size() == 3; }));
  std::vector<absl::StatusCode> codes;
  for (const absl::Status& trouble : heard.troubles()) codes.push_back(trouble.code());
  EXPECT_THAT(codes, ::testing::UnorderedElementsAre(absl::StatusCode::kResourceExhausted, absl::StatusCode::kOk,
                                                     absl::StatusCode::kDataLoss));
  EXPECT_LT(heard.durable(), 10u);
}

}  // namespace romap::store::store_test
