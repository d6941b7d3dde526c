// SPDX-License-Identifier: AGPL-3.0-or-later
// Runs a fuzz target without libFuzzer: its corpus first, then seeded changes of it. The same seed and number of runs give the same inputs
// on every machine.
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "services/base/random.h"
#include "tests/fuzz/corpus_files.h"
#include "tests/fuzz/mutate.h"
#include "tests/fuzz/subject.h"
#include "tests/fuzz/watchdog.h"

namespace vorocast::fuzz {
namespace {

constexpr std::size_t kSizeMax = 1 << 21;
constexpr std::size_t kChangedSizeMax = 1 << 16;

void RunWatched(const std::string& input) {
  WatchedInputBegins(input);
  // A copy of exactly its size, so that a sanitizer sees a read past the end.
  std::vector<std::uint8_t> bytes(input.begin(), input.end());
  LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  WatchedInputEnds();
}

/// Whether it survived. The program ends, and keeps the input, when it was let through though it is wrong.
bool RunContained(const std::string& input) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    KeepNoInput();
    RunWatched(input);
    _exit(0);
  }
  int status = 0;
  if (child < 0 || waitpid(child, &status, 0) != child) {
    std::perror("fork");
    std::exit(2);
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == kLetThroughStatus) {
    WatchedInputBegins(input);
    std::abort();
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

struct Flags {
  std::int64_t runs = 1000;
  double seconds = 0;
  std::uint64_t seed = 1;
  std::string folder = ".";
  std::vector<std::string> inputs;
};

int Run(const char* program, const Flags& flags) {
  std::int64_t ended_badly = 0;
  const auto run = [&](const std::string& input) {
    if (!kSubject.contained || !flags.inputs.empty()) return RunWatched(input);
    if (!RunContained(input)) ++ended_badly;
  };
  Watch(program, flags.inputs.empty() ? flags.folder : "");
  if (!flags.inputs.empty()) {
    for (const std::string& path : flags.inputs) run(ReadInput(path));
    std::printf("%zu inputs: nothing found\n", flags.inputs.size());
    return 0;
  }
  std::vector<std::string> corpus = Corpus();
  const std::size_t corpus_size = corpus.size();
  for (const std::string& input : corpus) run(input);
  if (ended_badly > 0) {
    std::fprintf(stderr, "%lld inputs of the corpus itself end the process\n", static_cast<long long>(ended_badly));
    return 1;
  }
  // Changing a large one takes longer than reading it.
  std::erase_if(corpus, [](const std::string& input) { return input.size() > kChangedSizeMax; });
  if (corpus.empty()) corpus.emplace_back();
  base::Random random(flags.seed);
  const auto begin = std::chrono::steady_clock::now();
  const auto under_way = [&](std::int64_t done) {
    if (flags.seconds <= 0) return done < flags.runs;
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() < flags.seconds;
  };
  std::int64_t done = 0;
  for (; under_way(done); ++done) run(Mutate(corpus[random.Below(corpus.size())], corpus, kSubject.form, kSizeMax, random));
  std::printf("%zu inputs of the corpus and %lld changed ones: nothing found", corpus_size, static_cast<long long>(done));
  if (kSubject.contained) std::printf(", but %lld ended the process of their own that they ran in", static_cast<long long>(ended_badly));
  std::printf("\n");
  return 0;
}

}  // namespace
}  // namespace vorocast::fuzz

int main(int argc, char** argv) {
  vorocast::fuzz::Flags flags;
  CLI::App app("Runs a reader of untrusted bytes on its corpus, then on changes of it.");
  app.add_option("--runs", flags.runs, "So many changed inputs")->capture_default_str();
  app.add_option("--seconds", flags.seconds, "For so long instead, wall clock");
  app.add_option("--seed", flags.seed, "Of the changes")->capture_default_str();
  app.add_option("--keep", flags.folder, "Folder for an input that ends the program")->capture_default_str();
  app.add_option("inputs", flags.inputs, "Only these files, as they are");
  CLI11_PARSE(app, argc, argv);
  return vorocast::fuzz::Run(argv[0], flags);
}
