#include "common/label_png.h"

#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstring>
#include <string>
#include <vector>

#include "common/image_bytes.h"
#include "common/status.h"

namespace romap {
namespace {

// The input and the first error of one decoder. Trivial, because libpng leaves its functions with longjmp, which runs
// no destructors.
struct PngSource {
  const char* data;
  size_t left;
  char error[128];
};

void ReadPngBytes(png_structp png, png_bytep out, size_t count) {
  auto* source = static_cast<PngSource*>(png_get_io_ptr(png));
  if (count > source->left) png_error(png, "the file is truncated");
  std::memcpy(out, source->data, count);
  source->data += count;
  source->left -= count;
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
      : png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, source, FailPng, IgnorePngWarning)),
        info_(png_ == nullptr ? nullptr : png_create_info_struct(png_)) {
    if (png_ != nullptr) png_set_read_fn(png_, source, ReadPngBytes);
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  bool ok() const { return info_ != nullptr; }
  int channels() const { return png_get_channels(png_, info_); }

  // Each returns false on failure, with the error in the source. They contain the target of longjmp, so they have no
  // objects with destructors.
  bool ReadHeader() {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_check_for_invalid_index(png_, 0);  // an index without a color is a label as well
    png_read_info(png_, info_);
    return true;
  }
  // `rows`: pointers to rows of one byte per pixel, or two if `two_bytes`.
  bool ReadRows(png_bytepp rows, bool two_bytes) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_packing(png_);  // one byte per pixel, unchanged values
    if (two_bytes && std::endian::native == std::endian::little) png_set_swap(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    png_read_image(png_, rows);
    png_read_end(png_, nullptr);
    return true;
  }

 private:
  png_structp png_;
  png_infop info_;
};

}  // namespace

absl::StatusOr<cv::Mat> DecodeLabelPng(std::string_view bytes, int64_t max_pixels) {
  const std::optional<EncodedSize> size = PngHeader(bytes);
  if (!size) return InvalidArgument("{} bytes are not a PNG file", bytes.size());
  if (size->width_px <= 0 || size->height_px <= 0 ||
      static_cast<int64_t>(size->width_px) * size->height_px > max_pixels) {
    return InvalidArgument("PNG header states {}x{} px; expected at most {} pixels", size->width_px, size->height_px,
                           max_pixels);
  }
  if (!IsCompletePng(bytes)) return InvalidArgument("PNG file is truncated ({} bytes)", bytes.size());
  PngSource source{bytes.data(), bytes.size(), {}};
  PngReader reader(&source);
  if (!reader.ok()) return Internal("libpng cannot be initialized");
  if (!reader.ReadHeader()) return InvalidArgument("PNG file is damaged: {}", std::string(source.error));
  if (reader.channels() != 1) {
    return InvalidArgument("PNG has {} channels; expected one channel whose value is the label (gray or palette)",
                           reader.channels());
  }
  const bool two_bytes = size->bits == 16;
  cv::Mat values(size->height_px, size->width_px, two_bytes ? CV_16UC1 : CV_8UC1);
  std::vector<png_bytep> rows(static_cast<size_t>(values.rows));
  for (int y = 0; y < values.rows; ++y) rows[static_cast<size_t>(y)] = values.ptr(y);
  if (!reader.ReadRows(rows.data(), two_bytes)) {
    return InvalidArgument("PNG file is damaged: {}", std::string(source.error));
  }
  if (two_bytes) return values;
  cv::Mat labels;
  values.convertTo(labels, CV_16U);
  return labels;
}

}  // namespace romap
