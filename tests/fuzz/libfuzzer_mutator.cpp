// SPDX-License-Identifier: AGPL-3.0-or-later
// Gives libFuzzer the target's inputs and mutations, so that it needs no corpus folder.
#include <algorithm>
#include <cstring>

#include "tests/fuzz/corpus_files.h"
#include "tests/fuzz/mutate.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* bytes, std::size_t size, std::size_t size_max);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* bytes, std::size_t size, std::size_t size_max, unsigned int seed) {
  namespace fuzz = vorocast::fuzz;
  static const std::vector<std::string> corpus = fuzz::Corpus();
  vorocast::base::Random random(seed);
  const bool afresh = size < 2 || random.Below(100) == 0;
  if (!afresh && random.Below(2) == 0) return LLVMFuzzerMutate(bytes, size, size_max);
  std::string input = afresh ? corpus[random.Below(corpus.size())] : std::string(fuzz::View(bytes, size));
  if (!afresh || random.Below(4) != 0) input = fuzz::Mutate(std::move(input), corpus, fuzz::kSubject.form, size_max, random);
  input.resize(std::min(input.size(), size_max));
  std::memcpy(bytes, input.data(), input.size());
  return input.size();
}
