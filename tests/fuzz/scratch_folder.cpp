// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/fuzz/scratch_folder.h"

#include <cstdio>
#include <cstdlib>
#include <fstream>

namespace vorocast::fuzz {

ScratchFolder::ScratchFolder() {
  // In memory where the system has such a folder: thousands of small files are written.
  std::error_code none;
  const std::filesystem::path memory = "/dev/shm";
  std::string pattern = (std::filesystem::is_directory(memory, none) ? memory : std::filesystem::temp_directory_path()) / "vorocast_fuzz_XXXXXX";
  if (!mkdtemp(pattern.data())) {
    std::perror(pattern.c_str());
    std::exit(2);
  }
  path_ = pattern;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::filesystem::path ScratchFolder::Write(const std::string& name, std::string_view bytes) const {
  const std::filesystem::path path = path_ / name;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (file.fail()) {
    std::perror(path.c_str());
    std::exit(2);
  }
  return path;
}

}  // namespace vorocast::fuzz
