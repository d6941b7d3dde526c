// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/capture/file_bytes.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <system_error>

namespace vorocast::capture {

absl::StatusOr<std::string> ReadFileBytes(const std::filesystem::path& path, std::uint64_t size_max) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) return absl::NotFoundError("there is no such file: check the path");
  // Reading a device or a pipe might never end.
  if (!std::filesystem::is_regular_file(status)) return absl::InvalidArgumentError("is no regular file");
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return absl::UnavailableError(fmt::format("cannot be measured: {}", error.message()));
  if (size > size_max) return absl::InvalidArgumentError(fmt::format("has {} bytes, more than the {} that are read", size, size_max));

  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (file == nullptr) {
    const std::string reason = std::strerror(errno);
    if (errno == EACCES) return absl::PermissionDeniedError(fmt::format("cannot be opened: {}; check its permissions", reason));
    return absl::UnavailableError(fmt::format("cannot be opened: {}", reason));
  }
  std::string bytes(static_cast<std::size_t>(size), '\0');
  bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file.get()));
  if (std::ferror(file.get()) != 0) return absl::UnavailableError(fmt::format("cannot be read to its end: {}", std::strerror(errno)));
  return bytes;
}

}  // namespace vorocast::capture
