// SPDX-License-Identifier: AGPL-3.0-or-later
#include "tests/fuzz/corpus_files.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

std::string ReadInput(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (!file.bad() && file.is_open()) return bytes;
  std::fprintf(stderr, "%s: cannot be read\n", path.c_str());
  std::exit(2);
}

std::vector<std::string> Corpus() {
  std::vector<std::string> inputs = MadeInputs();
  std::vector<std::filesystem::path> paths;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(VOROCAST_FUZZ_CORPUS, none)) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  for (const auto& path : paths) inputs.push_back(ReadInput(path));
  if (inputs.empty()) inputs.emplace_back();
  return inputs;
}

void Require(bool condition, std::string_view what) {
  if (condition) return;
  std::fprintf(stderr, "should not have been let through: %.*s\n", static_cast<int>(what.size()), what.data());
  if (kSubject.contained) _exit(kLetThroughStatus);
  std::abort();
}

}  // namespace vorocast::fuzz
