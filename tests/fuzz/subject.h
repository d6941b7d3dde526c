// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// What a fuzz target is given: any bytes. It must neither crash, nor throw, nor take long, and may check that what a reader lets through is right.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size);

/// What a fuzz target says of itself beside LLVMFuzzerTestOneInput. Two programs are made of every target: one with the driver of this folder
/// (any compiler), one with libFuzzer (clang). Both start from the same inputs and use the same mutations.
namespace vorocast::fuzz {

/// How a target's inputs are changed besides bit by bit.
enum class Form : std::uint8_t {
  kBytes,  // as bytes only
  kText,   // its numbers too
  kJson,   // its values and fields too
};

struct Subject {
  Form form = Form::kBytes;
  /// Inputs that a library crashes on, which only ever runs in a process of its own: each input does here too, and a crash is counted, not reported.
  /// What Require refuses ends the program as elsewhere.
  bool contained = false;
};
extern const Subject kSubject;

/// Valid inputs made by code, in addition to those under corpus/: binary files do not belong into the repository.
std::vector<std::string> MadeInputs();

/// Ends the program when a target finds a value that should not have been let through; both drivers keep the input.
void Require(bool condition, std::string_view what);
/// How the own process of a contained input ends then.
inline constexpr int kLetThroughStatus = 3;

/// `before`, a list within lists 100,000 deep, `after`: what recurses over a value runs out of stack.
inline std::string VeryDeep(const std::string& before, const std::string& after) {
  constexpr std::size_t kDepth = 100'000;
  return before + std::string(kDepth, '[') + std::string(kDepth, ']') + after;
}

inline std::string_view View(const std::uint8_t* bytes, std::size_t size) { return {reinterpret_cast<const char*>(bytes), size}; }

}  // namespace vorocast::fuzz
