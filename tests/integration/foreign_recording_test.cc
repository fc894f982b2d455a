// Recordings in the layouts of other projects give the same map as the sequence that they were made from.

#include <gmock/gmock.h>

#include <filesystem>

#include "client/files/sequence.h"
#include "tests/integration/recording_fixture.h"
#include "tests/support/foreign_layouts.h"

namespace romap::foreign_recording_test {

using recordings::RunResult;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using testing_support::SampleRecording;

class ForeignRecordingTest : public recordings::RecordingTest {
 protected:
  SampleRecording Sample() const {
    const auto sequence = files::Sequence::Open(recording().dir(), {.use_depth = true});
    EXPECT_TRUE(sequence.ok()) << sequence.status();
    return testing_support::SampleOf(*sequence);
  }

  // Hardly any training, as Run().
  RunResult RunBriefly(const std::string& source, std::vector<std::string> options) {
    options.insert(options.end(), {"--max-training", testing_support::kUnderSanitizer ? "90" : "1"});
    return RunOn(source, options);
  }

  static void ExpectTheSameCounts(const RunResult& foreign, const RunResult& native) {
    ExpectTheMap(foreign);
    for (const char* count : {"sent", "accepted", "with_pose"}) {
      EXPECT_EQ(foreign.summary["frames"][count], native.summary["frames"][count]) << count;
    }
    EXPECT_EQ(foreign.summary["masks"]["sent_with_frames"], native.summary["masks"]["sent_with_frames"]);
  }

  testing_support::TemporaryFolder foreign_;
};

TEST_F(ForeignRecordingTest, ColmapWithCocoMasks) {
  const SampleRecording sample = Sample();
  WriteColmapLayout(sample, foreign_ / "colmap", /*binary=*/true);
  std::filesystem::remove_all(foreign_ / "colmap/masks");
  WriteMasks(sample, foreign_ / "coco.json", testing_support::MaskLayout::kCocoCompressed);
  const RunResult native = Run();
  const RunResult foreign = RunBriefly(foreign_ / "colmap", {"--masks", foreign_ / "coco.json", "--fps", "25"});
  ExpectTheSameCounts(foreign, native);
  EXPECT_EQ(foreign.Classes(), native.Classes());
  EXPECT_THAT(foreign.Codes(), Contains("layout"));
  EXPECT_THAT(foreign.process.err, HasSubstr("read as COLMAP model"));
}

TEST_F(ForeignRecordingTest, Nerfstudio) {
  WriteTransformsLayout(Sample(), foreign_ / "scene");
  const RunResult native = Run({"--depth"});
  const RunResult foreign = RunBriefly(foreign_ / "scene", {"--depth"});
  ExpectTheSameCounts(foreign, native);
  EXPECT_THAT(foreign.Codes(), Not(Contains("depth_contradicts_images")));
}

TEST_F(ForeignRecordingTest, ImportedSequencesAreSound) {
  WriteBopLayout(Sample(), foreign_ / "scene");
  const auto imported =
      testing_support::RunProcess({ROMAP_CLIENT, "import", foreign_ / "scene", foreign_ / "sequence"});
  EXPECT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_THAT(imported.out, HasSubstr("60 frames, 60 with masks, 60 with depth, 60 with a pose"));
  const auto doctor = testing_support::RunProcess({ROMAP_CLIENT, "doctor", foreign_ / "sequence", "--depth"});
  EXPECT_EQ(doctor.exit_code, 0) << doctor.out << doctor.err;
  EXPECT_THAT(doctor.out, HasSubstr("0 errors"));
}

TEST_F(ForeignRecordingTest, UnknownLayoutsAreErrors) {
  const auto result = testing_support::RunProcess({ROMAP_CLIENT, "doctor", foreign_.path()});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("not a known layout of recordings; found an empty folder; looked for"));
}

}  // namespace romap::foreign_recording_test
