#include "tests/support/test_png.h"

#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace romap::testing_support {
namespace {

std::string BigEndian32(uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
  return bytes;
}

// The header of a TIFF file with one directory, which has one entry: the orientation.
std::string ExifBlock(int orientation) {
  std::string block("MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\0\0\0\0\0\0\0", 26);
  block[19] = static_cast<char>(orientation);
  return block;
}

void AppendBytes(png_structp png, png_bytep data, size_t count) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(data), count);
}
void FlushNothing(png_structp /*png*/) {}
void ThrowError(png_structp /*png*/, png_const_charp message) { throw std::runtime_error(message); }

}  // namespace

std::string EncodeLabels(const cv::Mat& labels, PngKind kind, int bits, bool interlaced) {
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, ThrowError, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(png, &bytes, AppendBytes, FlushNothing);
  png_set_IHDR(png, info, static_cast<png_uint_32>(labels.cols), static_cast<png_uint_32>(labels.rows), bits,
               kind == PngKind::kPalette ? PNG_COLOR_TYPE_PALETTE : PNG_COLOR_TYPE_GRAY,
               interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  std::vector<png_color> palette(size_t{1} << bits);
  for (size_t k = 0; k < palette.size(); ++k) {
    palette[k] = {static_cast<png_byte>(200 - k), static_cast<png_byte>(37 * k), static_cast<png_byte>(90 + 5 * k)};
  }
  if (kind == PngKind::kPalette) png_set_PLTE(png, info, palette.data(), static_cast<int>(palette.size()));
  png_write_info(png, info);
  png_set_packing(png);
  std::vector<png_bytep> rows;
  for (int y = 0; y < labels.rows; ++y) rows.push_back(const_cast<png_bytep>(labels.ptr(y)));
  png_write_image(png, rows.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

std::string PngChunk(const std::string& type, const std::string& data) {
  const std::string body = type + data;
  const auto checksum =
      static_cast<uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size())));
  return BigEndian32(static_cast<uint32_t>(data.size())) + body + BigEndian32(checksum);
}

std::string Deflate(const std::string& data, size_t zeros) {
  z_stream stream{};
  if (deflateInit(&stream, Z_BEST_COMPRESSION) != Z_OK) throw std::runtime_error("deflateInit failed");
  std::string result;
  const auto add = [&](const std::string& piece, int flush) {
    std::vector<Bytef> out(piece.size() + 1024);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(piece.data()));
    stream.avail_in = static_cast<uInt>(piece.size());
    do {
      stream.next_out = out.data();
      stream.avail_out = static_cast<uInt>(out.size());
      deflate(&stream, flush);
      result.append(reinterpret_cast<const char*>(out.data()), out.size() - stream.avail_out);
    } while (stream.avail_out == 0);
  };
  add(data, Z_NO_FLUSH);
  for (const std::string block(1 << 20, '\0'); zeros > 0; zeros -= std::min(zeros, block.size())) {
    add(block.substr(0, zeros), Z_NO_FLUSH);
  }
  add("", Z_FINISH);
  deflateEnd(&stream);
  return result;
}

std::string WithOrientation(const std::string& bytes, int orientation) {
  const std::string exif = ExifBlock(orientation);
  std::string result = bytes;
  if (bytes.starts_with("\xff\xd8")) {
    const std::string data = std::string("Exif\0\0", 6) + exif;
    const size_t length = data.size() + 2;
    result.insert(2, std::string("\xff\xe1") + static_cast<char>(length >> 8) + static_cast<char>(length) + data);
  } else {
    constexpr size_t kAfterHeader = 33;
    result.insert(kAfterHeader, PngChunk("eXIf", exif));
  }
  return result;
}

}  // namespace romap::testing_support
