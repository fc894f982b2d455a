// `romap doctor` on a sound recording and on wrong ones.

#include <gmock/gmock.h>

#include "tests/integration/recording_fixture.h"

namespace romap::doctor_test {

using ::testing::HasSubstr;

class DoctorTest : public recordings::RecordingTest {
 protected:
  testing_support::ProcessResult Diagnose(const std::vector<std::string>& options = {}) const {
    std::vector<std::string> command = {ROMAP_CLIENT, "doctor", recording().dir()};
    command.insert(command.end(), options.begin(), options.end());
    return testing_support::RunProcess(command);
  }
};

TEST_F(DoctorTest, SoundRecording) {
  const testing_support::ProcessResult result = Diagnose();
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("\n0 errors, 0 warnings\n"));
  EXPECT_THAT(result.out, HasSubstr("masks in 60 frames"));
}

TEST_F(DoctorTest, NamesAWrongPoseConventionAndAcceptsTheOptionThatItAdvises) {
  ChangePoses([](const SE3<World, Camera>& pose) {
    const SE3<Camera, World> inverse = pose.Inverse();
    return SE3<World, Camera>{inverse.rotation(), inverse.translation()};
  });
  const testing_support::ProcessResult wrong = Diagnose();
  EXPECT_NE(wrong.exit_code, 0);
  EXPECT_THAT(wrong.out, HasSubstr("error: poses_contradict_images"));
  EXPECT_THAT(wrong.out, HasSubstr("--pose-convention world_to_camera"));
  const testing_support::ProcessResult right = Diagnose({"--pose-convention", "world_to_camera"});
  EXPECT_EQ(right.exit_code, 0) << right.out;
  EXPECT_THAT(right.out, HasSubstr("\n0 errors, 0 warnings\n"));
}

TEST_F(DoctorTest, RecordingWithoutMasks) {
  recording().Write("mask.txt", "");
  const testing_support::ProcessResult result = Diagnose();
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.out, HasSubstr("error: masks_missing"));
}

}  // namespace romap::doctor_test
