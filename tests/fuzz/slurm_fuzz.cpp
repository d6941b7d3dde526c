// SPDX-License-Identifier: AGPL-3.0-or-later
// What Slurm's programs print.
#include "scheduler/fleet/slurm_queue.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {

const Subject kSubject = {.form = Form::kJson};
std::vector<std::string> MadeInputs() {
  return {"1-4,7,9-13:2%8", "12;cluster\n", VeryDeep(R"({"jobs": [{"name": "vorocast", "job_state": "RUNNING", "array_job_id": {"set": )", "}}]}")};
}

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  const std::string_view text = fuzz::View(bytes, size);
  if (const auto members = fleet::ParseQueue(text, "vorocast"); members.ok()) {
    for (const auto& member : *members) fuzz::Require(member.job > 0 && member.task >= 0, "a member that scancel cannot name");
  }
  fuzz::Require(fleet::ParseTaskRanges(text, 100).size() <= 100, "more tasks than asked for");
  if (const auto job = fleet::ParseSubmitted(text); job.ok()) fuzz::Require(*job > 0, "a job number");
  return 0;
}
