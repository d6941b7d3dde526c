// SPDX-License-Identifier: AGPL-3.0-or-later
#include <fmt/format.h>
#include <png.h>

#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <memory>
#include <system_error>

#include "services/base/check.h"
#include "services/rendering/sheet.h"

namespace vorocast::rendering {
namespace {

/// libpng leaves by longjmp: nothing with a destructor may live in this function.
bool Encode(std::FILE* file, const Image& image) {
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_init_io(png, file);
  // Fixed, so that bytes depend on the pixels alone; no time chunk is written.
  png_set_compression_level(png, 6);
  png_set_filter(png, 0, PNG_FILTER_SUB);
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height), 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
  png_write_info(png, info);
  const std::size_t stride = 3 * static_cast<std::size_t>(image.width);
  for (std::int32_t row = 0; row < image.height; ++row) png_write_row(png, image.rgb.data() + static_cast<std::size_t>(row) * stride);
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return true;
}

}  // namespace

absl::Status WritePng(const std::filesystem::path& path, const Image& image) {
  VOROCAST_CHECK(image.width > 0 && image.height > 0);
  VOROCAST_CHECK(image.rgb.size() == 3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wb"), &std::fclose);
  if (file == nullptr) {
    return absl::UnavailableError(
        fmt::format("{}: cannot be written: {}; check that its folder exists and is yours", path.string(), std::strerror(errno)));
  }
  const bool encoded = Encode(file.get(), image);
  const bool closed = std::fclose(file.release()) == 0;
  if (encoded && closed) return absl::OkStatus();
  const std::string reason = std::strerror(errno);
  std::error_code ignored;
  std::filesystem::remove(path, ignored);  // half a picture is worse than none
  return absl::UnavailableError(fmt::format("{}: cannot be written to its end: {}; check the disk's free space", path.string(), reason));
}

}  // namespace vorocast::rendering
