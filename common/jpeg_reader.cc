#include "common/jpeg_reader.h"

#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <string>

#include "common/status.h"

// These must follow <cstdio> and <cstddef>.
#include <jerror.h>
#include <jpeglib.h>

namespace romap {
namespace {

// The state of one decoder for the functions that libjpeg calls. Trivial, because they leave with longjmp, which runs
// no destructors.
struct JpegState {
  jpeg_error_mgr error_manager;        // libjpeg knows its address
  jpeg_progress_mgr progress_manager;  // the same
  std::jmp_buf on_error;
  const std::stop_token* stop;
  bool is_stopped;
  bool is_truncated;
  int scans;  // more than allowed; 0: not more
  char error[JMSG_LENGTH_MAX];
};

JpegState* StateOf(j_common_ptr jpeg) { return static_cast<JpegState*>(jpeg->client_data); }

[[noreturn]] void FailJpeg(j_common_ptr jpeg) {
  JpegState* state = StateOf(jpeg);
  jpeg->err->format_message(jpeg, state->error);
  std::longjmp(state->on_error, 1);
}

// Negative levels are warnings about the data. libjpeg repairs the image; it fills the end of a truncated file with
// gray.
void NoteJpegWarning(j_common_ptr jpeg, int level) {
  if (level >= 0) return;
  ++jpeg->err->num_warnings;
  if (jpeg->err->msg_code != JWRN_JPEG_EOF) return;
  StateOf(jpeg)->is_truncated = true;
  FailJpeg(jpeg);
}

void IgnoreJpegMessage(j_common_ptr /*jpeg*/) {}

// Called for every row of blocks of every scan.
void CheckJpegProgress(j_common_ptr jpeg) {
  JpegState* state = StateOf(jpeg);
  const int scan = reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number;
  if (scan > kMaxJpegScans) state->scans = scan;
  state->is_stopped = state->stop->stop_requested();
  if (state->scans > 0 || state->is_stopped) std::longjmp(state->on_error, 1);
}

// Owns the structures of libjpeg. Each method returns false on failure, with the cause in the state. They contain the
// target of longjmp, so they have no objects with destructors.
class JpegReader {
 public:
  explicit JpegReader(const std::stop_token& stop) {
    jpeg_.err = jpeg_std_error(&state_.error_manager);
    jpeg_.client_data = &state_;
    state_.error_manager.error_exit = FailJpeg;
    state_.error_manager.emit_message = NoteJpegWarning;
    state_.error_manager.output_message = IgnoreJpegMessage;
    state_.progress_manager.progress_monitor = CheckJpegProgress;
    state_.stop = &stop;
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  const JpegState& state() const { return state_; }
  int width_px() const { return static_cast<int>(jpeg_.image_width); }
  int height_px() const { return static_cast<int>(jpeg_.image_height); }
  int channels() const { return jpeg_.num_components; }
  int bits() const { return jpeg_.data_precision; }

  bool ReadHeader(std::string_view bytes) {
    if (setjmp(state_.on_error) != 0) return false;
    jpeg_create_decompress(&jpeg_);  // keeps `err` and `client_data`
    jpeg_.progress = &state_.progress_manager;
    jpeg_mem_src(&jpeg_, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
    return jpeg_read_header(&jpeg_, TRUE) == JPEG_HEADER_OK;
  }
  bool Start() {
    if (setjmp(state_.on_error) != 0) return false;
    // A progressive file needs the coefficients of the whole image: at most 3 x 2 bytes for each pixel.
    jpeg_.mem->max_memory_to_use = (16L << 20) + 8L * width_px() * height_px();
    jpeg_.out_color_space = JCS_EXT_BGR;
    return jpeg_start_decompress(&jpeg_) == TRUE;
  }
  bool Produces(const cv::Mat& image) const {
    return image.type() == CV_8UC(jpeg_.output_components) && image.cols == static_cast<int>(jpeg_.output_width) &&
           image.rows == static_cast<int>(jpeg_.output_height);
  }
  bool ReadRows(unsigned char* data, size_t stride) {
    if (setjmp(state_.on_error) != 0) return false;
    while (jpeg_.output_scanline < jpeg_.output_height) {
      JSAMPROW row = data + stride * jpeg_.output_scanline;
      jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    return jpeg_finish_decompress(&jpeg_) == TRUE;
  }

 private:
  jpeg_decompress_struct jpeg_{};
  JpegState state_{};
};

absl::Status ErrorOf(const JpegState& state, std::string_view bytes) {
  if (state.is_stopped) return absl::CancelledError("decoding was stopped");
  if (!bytes.starts_with("\xff\xd8")) return InvalidArgument("{} bytes are not a JPEG file", bytes.size());
  if (state.is_truncated) return InvalidArgument("JPEG file is truncated ({} bytes)", bytes.size());
  if (state.scans > 0) {
    return InvalidArgument("JPEG file has {} or more scans; must have at most {}", state.scans, kMaxJpegScans);
  }
  return InvalidArgument("JPEG file is damaged: {}", std::string(state.error));
}

}  // namespace

absl::StatusOr<EncodedSize> JpegHeader(std::string_view bytes) {
  const std::stop_token never;
  JpegReader reader(never);
  if (!reader.ReadHeader(bytes)) return ErrorOf(reader.state(), bytes);
  return EncodedSize{reader.width_px(), reader.height_px(), reader.bits(), reader.channels()};
}

absl::StatusOr<cv::Mat> DecodeJpeg(std::string_view bytes, const DecodeLimits& limits) {
  JpegReader reader(limits.stop);
  if (!reader.ReadHeader(bytes)) return ErrorOf(reader.state(), bytes);
  if (int64_t{reader.width_px()} * reader.height_px() > limits.max_pixels) {
    return InvalidArgument("JPEG header states {}x{} px; expected at most {} pixels", reader.width_px(),
                           reader.height_px(), limits.max_pixels);
  }
  if (reader.channels() != 1 && reader.channels() != 3) {
    return InvalidArgument("JPEG has {} color components; expected 1 (gray) or 3 (color)", reader.channels());
  }
  if (!reader.Start()) return ErrorOf(reader.state(), bytes);
  cv::Mat image(reader.height_px(), reader.width_px(), CV_8UC3);
  if (!reader.Produces(image)) return Internal("libjpeg decodes to another size than the header states");
  if (!reader.ReadRows(image.data, image.step)) return ErrorOf(reader.state(), bytes);
  return image;
}

}  // namespace romap
