// SPDX-License-Identifier: AGPL-3.0-or-later
// A job's record, and the plan that is made of it.
#include <nlohmann/json.hpp>

#include "scheduler/plan/plan.h"
#include "tests/fuzz/small_take.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kJson};

std::vector<std::string> MadeInputs() {
  plan::JobSpec with_film;
  with_film.film.emplace();
  return {plan::ToJson(plan::JobSpec{}).dump(), plan::ToJson(with_film).dump(), VeryDeep(R"({"effect": )", "}")};
}

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  const auto json = nlohmann::json::parse(fuzz::View(bytes, size), nullptr, false);
  if (json.is_discarded()) return 0;
  const auto spec = plan::JobSpecFromJson(json);
  if (!spec.ok()) return 0;
  fuzz::Require(plan::JobSpecFromJson(plan::ToJson(*spec)).ok(), "a job that cannot be recorded");
  (void)plan::Plan(*spec, fuzz::SmallTake(30), false);
  (void)plan::Plan(*spec, fuzz::SmallTake(30), true);
  return 0;
}
