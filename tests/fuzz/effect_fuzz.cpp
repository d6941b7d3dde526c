// SPDX-License-Identifier: AGPL-3.0-or-later
// Effects as clients send them.
#include "services/simulation/effect.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kJson};

std::vector<std::string> MadeInputs() {
  std::vector<std::string> inputs = {VeryDeep(R"({"name": )", "}")};
  for (const std::string& name : simulation::ShippedEffects()) inputs.push_back(simulation::LoadEffect(name)->dump());
  return inputs;
}

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  const auto effect = simulation::ParseEffect(fuzz::View(bytes, size));
  if (!effect.ok()) return 0;
  // What is canonical stays as it is: its text is part of results' keys.
  const auto again = simulation::ParseEffect(effect->dump());
  fuzz::Require(again.ok() && again->dump() == effect->dump(), "an effect whose canonical form changes when it is read again");
  return 0;
}
