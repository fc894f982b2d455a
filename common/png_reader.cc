#include "common/png_reader.h"

#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstring>
#include <optional>
#include <string>

#include "common/image_bytes.h"
#include "common/status.h"

namespace romap {
namespace {

// libpng decompresses all data behind the last row, which may be a thousand times the size of the file.
constexpr size_t kMaxBytesAfterImage = 65536;

// The input and the first error of one decoder. Trivial, because libpng leaves its functions with longjmp, which runs
// no destructors.
struct PngSource {
  const char* data;
  size_t left;
  size_t may_read;  // at most `left`
  const std::stop_token* stop;
  bool is_stopped;
  char error[128];
};

void ReadPngBytes(png_structp png, png_bytep out, size_t count) {
  auto* source = static_cast<PngSource*>(png_get_io_ptr(png));
  source->is_stopped = source->stop->stop_requested();
  if (source->is_stopped) png_error(png, "stopped");
  if (count > source->left) png_error(png, "the file is truncated");
  if (count > source->may_read) png_error(png, "more data than the image needs");
  std::memcpy(out, source->data, count);
  source->data += count;
  source->left -= count;
  source->may_read -= count;
}

void FailPng(png_structp png, png_const_charp message) {
  auto* source = static_cast<PngSource*>(png_get_error_ptr(png));
  std::strncpy(source->error, message, sizeof(source->error) - 1);
  longjmp(png_jmpbuf(png), 1);
}

void IgnorePngWarning(png_structp /*png*/, png_const_charp /*message*/) {}

// Owns the structures of libpng.
class PngReader {
 public:
  explicit PngReader(PngSource* source)
      : source_(source),
        png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, source, FailPng, IgnorePngWarning)),
        info_(png_ == nullptr ? nullptr : png_create_info_struct(png_)) {
    if (png_ != nullptr) png_set_read_fn(png_, source, ReadPngBytes);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  bool ok() const { return info_ != nullptr; }
  int64_t height_px() const { return png_get_image_height(png_, info_); }
  int channels() const { return png_get_channels(png_, info_); }
  bool has_two_bytes() const { return png_get_bit_depth(png_, info_) == 16; }
  size_t bytes_per_row() const { return png_get_rowbytes(png_, info_); }

  // Each returns false on failure, with the error in the source. They contain the target of longjmp, so they have no
  // objects with destructors.
  bool ReadHeader() {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_check_for_invalid_index(png_, 0);  // an index without a color is a label as well
    // All parts but IHDR, PLTE, tRNS, IDAT and IEND.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_read_info(png_, info_);
    return true;
  }
  // The pixels in the byte order of the machine. Afterwards the getters describe the converted image.
  bool Convert(PngPixels pixels) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    if (has_two_bytes() && std::endian::native == std::endian::little) png_set_swap(png_);
    if (pixels == PngPixels::kStored) {
      png_set_packing(png_);  // one byte per pixel, unchanged values
    } else {
      const png_byte type = png_get_color_type(png_, info_);
      if (type == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png_);
      if ((type & PNG_COLOR_MASK_COLOR) == 0) {
        png_set_expand_gray_1_2_4_to_8(png_);
        png_set_gray_to_rgb(png_);
      }
      png_set_strip_alpha(png_);
      png_set_bgr(png_);
    }
    passes_ = png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }
  bool ReadRows(png_bytep data, size_t stride, size_t rows) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    for (int pass = 0; pass < passes_; ++pass) {
      for (size_t y = 0; y < rows; ++y) {
        if (pass + 1 == passes_ && y + 1 == rows) source_->may_read = bytes_per_row() + kMaxBytesAfterImage;
        png_read_row(png_, data + y * stride, nullptr);
      }
    }
    return true;
  }

 private:
  PngSource* const source_;
  png_structp png_;
  png_infop info_;
  int passes_ = 1;
};

absl::Status ErrorOf(const PngSource& source) {
  if (source.is_stopped) return absl::CancelledError("decoding was stopped");
  return InvalidArgument("PNG file is damaged: {}", std::string(source.error));
}

}  // namespace

absl::StatusOr<cv::Mat> DecodePng(std::string_view bytes, PngPixels pixels, const DecodeLimits& limits) {
  const std::optional<EncodedSize> header = PngHeader(bytes);
  if (!header) return InvalidArgument("{} bytes are not a PNG file", bytes.size());
  if (header->width_px <= 0 || header->height_px <= 0 ||
      int64_t{header->width_px} * header->height_px > limits.max_pixels) {
    return InvalidArgument("PNG header states {}x{} px; expected at most {} pixels", header->width_px,
                           header->height_px, limits.max_pixels);
  }
  if (!IsCompletePng(bytes)) return InvalidArgument("PNG file is truncated ({} bytes)", bytes.size());
  PngSource source{.data = bytes.data(),
                   .left = bytes.size(),
                   .may_read = bytes.size(),
                   .stop = &limits.stop,
                   .is_stopped = false,
                   .error = {}};
  PngReader reader(&source);
  if (!reader.ok()) return Internal("libpng cannot be initialized");
  if (!reader.ReadHeader()) return ErrorOf(source);
  if (pixels == PngPixels::kStored && reader.channels() != 1) {
    return InvalidArgument("PNG has {} channels; expected one channel whose value is the label (gray or palette)",
                           reader.channels());
  }
  if (!reader.Convert(pixels)) return ErrorOf(source);
  const int type = CV_MAKETYPE(reader.has_two_bytes() ? CV_16U : CV_8U, pixels == PngPixels::kStored ? 1 : 3);
  cv::Mat image(header->height_px, header->width_px, type);
  if (reader.height_px() != header->height_px || reader.bytes_per_row() != image.cols * image.elemSize()) {
    return Internal("libpng decodes to another size than the header states");
  }
  if (!reader.ReadRows(image.data, image.step, static_cast<size_t>(image.rows))) return ErrorOf(source);
  return image;
}

}  // namespace romap
