// SPDX-License-Identifier: AGPL-3.0-or-later
// What a child process tells its worker, and what is made of anything that it prints.
#include <nlohmann/json.hpp>

#include "services/lease/child_task.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kJson};
std::vector<std::string> MadeInputs() { return {VeryDeep(R"({"progress": )", "}")}; }

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  const std::string_view text = fuzz::View(bytes, size);
  const lease::ChildLine line = lease::DecodeChildLine(text);
  if (line.outcome) (void)lease::EncodeOutcome(*line.outcome);
  for (const std::size_t most : {std::size_t{8}, lease::kMessageBytesMax}) {
    for (const std::string& shown : {lease::TextForPeople(text, most), lease::TailForPeople(text, most)}) {
      fuzz::Require(shown.size() <= most, "a text longer than asked for");
      fuzz::Require(!nlohmann::json(shown).dump().empty(), "a text that is not UTF-8");  // or it throws
    }
  }
  return 0;
}
