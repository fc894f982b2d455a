#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "client/importers/video_file.h"
#include "tests/unit/client/importers/reading.h"

namespace romap::importers::video_reader_test {

using importers_testing::DiagnosticOf;
using importers_testing::Read;
using importers_testing::ReadError;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::WriteText;
namespace fs = std::filesystem;

constexpr int kVideoFrames = 160;  // more than a group of pictures

// The gray value of a frame tells its index.
int GrayOf(int frame) { return 20 + (frame * 37) % 200; }

// A video of 160x120 px at 25 Hz.
void WriteVideo(const std::string& path, const char* codec = "mp4v") {
  cv::VideoWriter writer(path, cv::CAP_FFMPEG, cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]), 25,
                         cv::Size(160, 120));
  ASSERT_TRUE(writer.isOpened()) << "OpenCV cannot write videos";
  for (int k = 0; k < kVideoFrames; ++k) writer.write(cv::Mat(120, 160, CV_8UC3, cv::Scalar::all(GrayOf(k))));
}

// A box of an MP4 file (ISO 14496-12).
class Mp4 {
 public:
  explicit Mp4(const std::string& path) : path_(path) {
    std::ifstream in(path, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  ~Mp4() { WriteText(path_, bytes_); }

  uint32_t Number(size_t at) const {
    uint32_t number = 0;
    for (size_t k = 0; k < 4; ++k) number = number << 8 | static_cast<uint8_t>(bytes_[at + k]);
    return number;
  }
  void SetNumber(size_t at, uint32_t number) {
    for (size_t k = 0; k < 4; ++k) bytes_[at + k] = static_cast<char>(number >> (24 - 8 * k));
  }
  // The positions of a box and of those around it.
  std::vector<size_t> Find(const std::vector<std::string>& names) const {
    std::vector<size_t> positions;
    size_t at = 0;
    for (const std::string& name : names) {
      while (at + 8 <= bytes_.size() && bytes_.substr(at + 4, 4) != name) at += Number(at);
      EXPECT_LT(at + 8, bytes_.size()) << name;
      positions.push_back(at);
      at += 8;
    }
    return positions;
  }
  // Frames from `first` on last twice as long.
  void SlowDownFrom(uint32_t first) {
    bytes_.replace(Find({"moov", "trak", "edts"}).back() + 4, 4, "free");  // it would cut the end off
    const std::vector<size_t> boxes = Find({"moov", "trak", "mdia", "minf", "stbl", "stts"});
    const size_t entries = boxes.back() + 12;
    const uint32_t frames = Number(entries + 4), duration = Number(entries + 8);
    EXPECT_EQ(Number(entries), 1u);
    SetNumber(entries, 2);
    SetNumber(entries + 4, first);
    bytes_.insert(entries + 12, std::string(8, '\0'));
    SetNumber(entries + 12, frames - first);
    SetNumber(entries + 16, 2 * duration);
    for (const size_t box : boxes) SetNumber(box, Number(box) + 8);
  }
  // The players turn the image by 90 degrees, clockwise.
  void Rotate() {
    const size_t matrix = Find({"moov", "trak", "tkhd"}).back() + 48;
    const uint32_t one = 1 << 16;
    const std::array<uint32_t, 9> values = {0, one, 0, 0u - one, 0, 0, 120 * one, 0, 1u << 30};
    for (size_t k = 0; k < values.size(); ++k) SetNumber(matrix + 4 * k, values[k]);
  }

 private:
  std::string path_, bytes_;
};

void ExpectFrame(const files::Sequence& sequence, size_t index, int video_frame) {
  const auto frame = sequence.Load(index);
  ASSERT_TRUE(frame.ok()) << frame.status();
  const cv::Mat raw(1, static_cast<int>(frame->image.size()), CV_8UC1, const_cast<char*>(frame->image.data()));
  const cv::Mat image = cv::imdecode(raw, cv::IMREAD_GRAYSCALE);
  EXPECT_NEAR(image.at<uint8_t>(60, 60), GrayOf(video_frame), 4) << "frame " << index;
}

TEST(VideoReaderTest, ReadsFramesInAnyOrder) {
  const testing_support::TemporaryFolder folder;
  WriteVideo(folder / "clip.mp4");
  const files::Sequence sequence = Read(folder / "clip.mp4");
  ASSERT_EQ(sequence.size(), static_cast<size_t>(kVideoFrames));
  EXPECT_EQ(sequence.camera().width_px, 160);
  EXPECT_NEAR(sequence.fps(), 25, 1e-6);
  for (const int k : {0, 1, 2, 30, 29, 159, 3, 120, 119, 40, 155, 0}) {
    EXPECT_EQ(sequence.timestamp_ns(static_cast<size_t>(k)), k * int64_t{40'000'000});
    ExpectFrame(sequence, static_cast<size_t>(k), k);
  }
  // A view of 60 degrees: 160 / 2 / tan(30 degrees).
  EXPECT_NEAR(sequence.camera().fx_px, 138.564, 1e-3);
  EXPECT_THAT(DiagnosticOf(sequence, "calibration_guessed").text,
              HasSubstr("no calibration: focal length 138.6 px guessed from a field of view of 60 degrees"));
}

// Neither the name nor the container matters.
TEST(VideoReaderTest, RecognizesVideosByContent) {
  const testing_support::TemporaryFolder folder;
  WriteVideo(folder / "clip.avi", "MJPG");
  fs::rename(folder / "clip.avi", folder / "clip");
  EXPECT_EQ(Read(folder / "clip").size(), static_cast<size_t>(kVideoFrames));
}

TEST(VideoReaderTest, VariableFrameRate) {
  const testing_support::TemporaryFolder folder;
  WriteVideo(folder / "clip.mp4");
  Mp4(folder / "clip.mp4").SlowDownFrom(50);
  const files::Sequence sequence = Read(folder / "clip.mp4");
  ASSERT_EQ(sequence.size(), static_cast<size_t>(kVideoFrames));
  for (const int k : {49, 50, 51, 158, 10, 140}) {
    const int64_t ticks = k <= 50 ? k : 50 + 2 * (k - 50);
    EXPECT_EQ(sequence.timestamp_ns(static_cast<size_t>(k)), ticks * 40'000'000) << k;
    ExpectFrame(sequence, static_cast<size_t>(k), k);
  }
}

TEST(VideoReaderTest, RotationTag) {
  const testing_support::TemporaryFolder folder;
  WriteVideo(folder / "clip.mp4");
  Mp4(folder / "clip.mp4").Rotate();
  const files::Sequence sequence = Read(folder / "clip.mp4");
  EXPECT_EQ(sequence.camera().width_px, 120);
  EXPECT_EQ(sequence.camera().height_px, 160);
  ExpectFrame(sequence, 5, 5);
}

TEST(VideoReaderTest, EveryFifthFrame) {
  const testing_support::TemporaryFolder folder;
  WriteVideo(folder / "clip.mp4");
  ReadOptions options = importers_testing::SampleOptions();
  options.every = 5;
  options.focal_px = 150;
  const files::Sequence sequence = Read(folder / "clip.mp4", options);
  ASSERT_EQ(sequence.size(), static_cast<size_t>(kVideoFrames) / 5);
  EXPECT_NEAR(sequence.fps(), 5, 1e-6);
  EXPECT_EQ(sequence.timestamp_ns(3), 600'000'000);
  ExpectFrame(sequence, 3, 15);
  EXPECT_EQ(sequence.camera().fx_px, 150);
}

// A playlist could make FFmpeg read other files.
TEST(VideoReaderTest, PlaylistsAreNoVideos) {
  const testing_support::TemporaryFolder folder;
  WriteVideo(folder / "clip.mp4");
  WriteText(folder / "list.m3u8", "#EXTM3U\n#EXTINF:6,\nclip.mp4\n#EXT-X-ENDLIST\n");
  EXPECT_THAT(ReadError(folder / "list.m3u8"), AllOf(HasSubstr("not a known layout"), HasSubstr("a file that is no")));
}

TEST(VideoReaderTest, Archives) {
  const testing_support::TemporaryFolder folder;
  WriteText(folder / "scan.r3d", std::string("PK\3\4", 4) + std::string(100, '\1'));
  EXPECT_THAT(ReadError(folder / "scan.r3d"), AllOf(HasSubstr("a ZIP archive"), HasSubstr("LZFSE")));
}

}  // namespace romap::importers::video_reader_test
