// SPDX-License-Identifier: AGPL-3.0-or-later
// What workers are told to do: tasks with their options, as they come in leases and as a child process gets them.
#include "services/lease/child_task.h"
#include "services/tasks/task.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kJson};
std::vector<std::string> MadeInputs() { return {VeryDeep(R"({"spec": {}, "store_root": )", "}")}; }

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  const std::string_view text = fuzz::View(bytes, size);
  if (const auto task = lease::DecodeChildTask(text); task.ok()) {
    fuzz::Require(lease::DecodeChildTask(lease::Encode(*task)).ok(), "a child's task that cannot be passed on");
  }
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_discarded()) return 0;
  const auto spec = tasks::TaskSpecFromJson(json);
  if (!spec.ok()) return 0;
  const auto again = tasks::TaskSpecFromJson(tasks::ToJson(*spec));
  fuzz::Require(again.ok() && again->Key() == spec->Key(), "a task with another key when it is read again");
  return 0;
}
