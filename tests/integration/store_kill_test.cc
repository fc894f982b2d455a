// A server that is killed while it compacts a session or adds one from a file.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <numeric>
#include <random>
#include <set>
#include <thread>

#include "server/store/catalog.h"
#include "server/store/session_transfer.h"
#include "server/store/store.h"
#include "tests/integration/server_process.h"
#include "tests/integration/slow_disk.h"

namespace romap::store_kill_test {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using ::testing::IsEmpty;
using testing_support::BackgroundProcess;
using testing_support::Eventually;

constexpr uint64_t kFrames = 60;
constexpr const char* kRule = "delay 120";  // makes the moments between two writes long enough to hit them

// ROMAP_TEST_KILLS: their number, for longer runs.
int Kills() {
  const char* text = std::getenv("ROMAP_TEST_KILLS");
  return text != nullptr ? std::atoi(text) : 4;
}

class StoreKillTest : public ::testing::Test {
 protected:
  // Two small sessions, and a large one whose old meshes fill a third of its files.
  void SetUp() override {
    const auto store = store::Store::Open({.data_dir = folder_ / "stored"}).value();
    for (const char* id : {"first", "large", "last"}) {
      const bool is_large = std::string(id) == "large";
      store::StoredSession session;
      session.id = id;
      session.options.camera = testing_support::SmallCamera();
      if (is_large) session.options.camera = LargeCamera();
      session.created_unix_ns = session.used_unix_ns = 1'000;
      EXPECT_OK(store->Create(session));
      for (uint64_t frame = 1; frame <= kFrames; ++frame) {
        FrameInput input = testing_support::MakeFrame(frame);
        if (is_large) Enlarge(input);
        store->AppendInput(id, std::move(input), /*may_wait=*/true);
      }
      if (is_large) AddOldMeshes(*store, id);
    }
    EXPECT_OK(store->Flush());
    std::ofstream file(folder_ / "large.romap", std::ios::binary);
    EXPECT_OK(store::SaveSession(*store, "large", [&](const std::string& piece) {
      file << piece;
      return absl::OkStatus();
    }));
  }

  static CameraModel LargeCamera() {
    CameraModel camera = testing_support::SmallCamera();
    camera.width_px = 640;
    camera.height_px = 480;
    camera.cx_px = 319.5;
    camera.cy_px = 239.5;
    return camera;
  }
  static void Enlarge(FrameInput& input) {
    input.raw_width_px = LargeCamera().width_px;
    input.raw_height_px = LargeCamera().height_px;
    input.image.assign(static_cast<size_t>(input.raw_width_px * input.raw_height_px), '\x80');
  }
  static void AddOldMeshes(store::Store& store, const std::string& session) {
    ObjectUpdate object;
    object.id = ObjectId{1};
    object.class_name = "mug";
    object.cuboid.half_extents = Eigen::Vector3d(0.1, 0.1, 0.1);
    store.PutObject(session, object);
    for (uint64_t revision = 1; revision <= 10; ++revision) {
      MeshUpdate mesh;
      mesh.id = object.id;
      mesh.revision = revision;
      mesh.draco.assign(1'000'000, static_cast<char>('a' + revision));
      store.PutMesh(session, std::move(mesh));
    }
  }

  // On a fresh copy of the stored sessions.
  void StartServer() {
    server_ = nullptr;
    fs::remove_all(folder_ / "data");
    fs::copy(folder_ / "stored", folder_ / "data", fs::copy_options::recursive);
    disk_.SetRule("");
    server_ = std::make_unique<integration::ServerProcess>(folder_ / "data", disk_.environment());
  }
  // Kill number `kill` of `kills` comes in the corresponding part of `period`.
  void KillWithin(milliseconds period, int kill, int kills) {
    const double share = (kill + std::uniform_real_distribution<double>(0, 1)(random_)) / kills;
    std::this_thread::sleep_for(std::chrono::duration<double>(share * std::chrono::duration<double>(period)));
    server_->Kill();
    disk_.SetRule("");
  }
  std::string PathOf(const std::string& session) const { return folder_ / "data/sessions/" + session; }
  std::set<std::string> FoldersOfSessions() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ / "data/sessions")) names.insert(entry.path().filename());
    return names;
  }
  // All sessions with all of their inputs, and no other files. Returns their ids.
  std::set<std::string> ExpectWholeSessions() {
    server_->Start();
    auto service = server_->Connect();
    std::vector<uint64_t> all(kFrames);
    std::iota(all.begin(), all.end(), 1);
    std::set<std::string> ids;
    const std::vector<SessionInfo> sessions = service->ListSessions().value();
    for (const SessionInfo& info : sessions) {
      ids.insert(info.id);
      EXPECT_EQ(integration::StoredInputs(*service, info.id).frames, all) << info.id;
    }
    for (const char* id : {"first", "large", "last"}) EXPECT_TRUE(ids.contains(id)) << id;
    service = nullptr;
    server_->Stop();
    EXPECT_EQ(FoldersOfSessions(), ids);
    const auto catalog =
        store::Catalog::Open(folder_ / "data/catalog.sqlite", store::Catalog::Mode::kReadWrite).value();
    for (const std::string& id : ids) {
      std::set<std::string> known, found;
      for (const auto& stored : catalog->Blobs(id)) known.insert(fmt::format("{:06}.seg", stored.blob.segment));
      for (const auto& entry : fs::directory_iterator(PathOf(id))) found.insert(entry.path().filename());
      EXPECT_EQ(found, known) << id;
    }
    return ids;
  }

  testing_support::TemporaryFolder folder_;
  integration::SlowDisk disk_{folder_ / "disk"};
  std::unique_ptr<integration::ServerProcess> server_;
  std::mt19937 random_{std::random_device{}()};
};

TEST_F(StoreKillTest, ACompactionIsDoneOrNot) {
  const int kills = Kills();
  int removed = 0;
  for (int kill = 0; kill < kills; ++kill) {
    StartServer();
    const auto service = server_->Connect();
    disk_.SetRule(kRule);
    EXPECT_OK(service->FinishSession("large").status());
    ASSERT_TRUE(Eventually([&] { return fs::exists(PathOf("large") + "/000001.seg"); })) << "no compaction";
    KillWithin(milliseconds(1000), kill, kills);
    const bool is_done = !fs::exists(PathOf("large") + "/000000.seg");
    if (is_done) ++removed;
    SCOPED_TRACE(fmt::format("kill {} of {}, the old files are {}", kill + 1, kills, is_done ? "removed" : "there"));
    ExpectWholeSessions();
  }
  fmt::print("{} kills, {} of them after the old files were removed\n", kills, removed);
}

TEST_F(StoreKillTest, ASessionFileIsAddedOrNot) {
  const int kills = Kills();
  int added = 0;
  for (int kill = 0; kill < kills; ++kill) {
    StartServer();
    disk_.SetRule(kRule);
    BackgroundProcess load(
        {ROMAP_CLIENT, "sessions", "--server", server_->address(), "--load", folder_ / "large.romap"});
    ASSERT_TRUE(Eventually([&] { return FoldersOfSessions().size() > 3; })) << "the import does not begin";
    KillWithin(milliseconds(1000), kill, kills);
    const testing_support::ProcessResult loaded = load.Wait();
    const bool client_knows = loaded.out.find("is session ") != std::string::npos;
    SCOPED_TRACE(fmt::format("kill {} of {}, {}{}", kill + 1, kills, loaded.out, loaded.err));
    const std::set<std::string> ids = ExpectWholeSessions();
    if (ids.size() > 3) ++added;
    EXPECT_GE(ids.size(), client_knows ? 4u : 3u);
  }
  fmt::print("{} kills, {} of them after the session was added\n", kills, added);
}

}  // namespace romap::store_kill_test
