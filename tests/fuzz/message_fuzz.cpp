// SPDX-License-Identifier: AGPL-3.0-or-later
// Messages of clients and workers, as the scheduler takes them apart. An input's first line says which, the rest is the message.
#include "scheduler/server/job_request.h"
#include "scheduler/server/upload_call.h"
#include "scheduler/server/work_messages.h"
#include "tests/fuzz/small_take.h"
#include "tests/fuzz/subject.h"

namespace vorocast::fuzz {
namespace {

void Take(const v1::SubmitJobRequest& request) {
  const auto terms = server::TermsOf(request);
  if (terms.ok()) Require(terms->time_factor > 0 && terms->deadline >= 0 && terms->memory_limit >= 0, "terms");
  const auto spec = server::SpecOf(request);
  if (!spec.ok()) return;
  Require(plan::JobSpecFromJson(plan::ToJson(*spec)).ok(), "a job that cannot be recorded");
  (void)plan::Plan(*spec, SmallTake(25), true);
}

void Take(const v1::WorkerMessage& message) {
  const auto event = server::EventOf(1, message);
  if (!event.ok()) return;
  const auto* finished = std::get_if<core::Finished>(&*event);
  if (!finished) return;
  const auto* failed = std::get_if<core::AttemptFailed>(&finished->outcome);
  if (!failed) return;
  Require(failed->seconds >= 0 && failed->cpu_seconds >= 0 && failed->memory_peak >= 0, "what an attempt took");
  // Clients get it in a message whose text must be UTF-8, or they cannot read the whole of it.
  v1::Failed passed_on;
  passed_on.set_message(failed->message);
  Require(passed_on.ParseFromString(passed_on.SerializeAsString()), "a failure's message that is not UTF-8");
}

void Take(const v1::Blob& blob) {
  if (server::CheckBlob(blob).ok()) Require(blob.size() >= 0 && blob.extension().size() == 4, "a blob");
}

template <typename Message>
bool TakeAs(std::string_view kind, std::string_view name, std::string_view bytes) {
  Message message;
  if (kind != name) return false;
  if (message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) Take(message);
  return true;
}

}  // namespace

const Subject kSubject = {.form = Form::kBytes};

std::vector<std::string> MadeInputs() {
  const std::string digest(64, 'a');
  v1::SubmitJobRequest submit;
  submit.set_sequence_id("walk");
  submit.set_cells(300);
  submit.set_effect_json(R"({"name": "release", "release": [{"by": "height"}]})");
  submit.set_user("anna");
  submit.set_time_factor(2);
  submit.mutable_film()->set_width(64);
  submit.mutable_film()->set_camera_json(R"({"eye_m": [0, 1, 3], "target_m": [0, 1, 0]})");
  v1::SubmitJobRequest plain = submit;
  plain.clear_effect_json();
  Require(server::SpecOf(plain).ok(), "an input that is meant to be valid, but is refused");
  v1::SubmitJobRequest deep;
  deep.set_effect_json(VeryDeep(R"({"name": )", "}"));
  v1::WorkerMessage hello;
  hello.mutable_hello()->set_worker("farm-1");
  hello.mutable_hello()->add_kinds("tessellate");
  hello.mutable_hello()->set_slots(2);
  hello.mutable_hello()->add_holding()->set_task_id(digest);
  v1::WorkerMessage finished;
  finished.mutable_finished()->mutable_id()->set_task_id(digest);
  finished.mutable_finished()->mutable_succeeded()->set_sha256(digest);
  v1::WorkerMessage failed;
  failed.mutable_finished()->mutable_id()->set_task_id(digest);
  // Of which the limit cuts a character in two.
  std::string message = "x";
  while (message.size() < 5000) message += "é";
  failed.mutable_finished()->mutable_failed()->set_message(message);
  v1::Blob blob;
  blob.set_sha256(digest);
  blob.set_extension(".ply");
  blob.set_size(12);
  return {"submit\n" + plain.SerializeAsString(), "submit\n" + submit.SerializeAsString(),   "submit\n" + deep.SerializeAsString(),
          "worker\n" + hello.SerializeAsString(), "worker\n" + finished.SerializeAsString(), "worker\n" + failed.SerializeAsString(),
          "blob\n" + blob.SerializeAsString()};
}

}  // namespace vorocast::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace vorocast;
  // It says of every text that is not UTF-8 that it is none.
  [[maybe_unused]] static const auto silenced = google::protobuf::SetLogHandler(nullptr);
  const std::string_view input = fuzz::View(bytes, size);
  const std::size_t line = input.find('\n');
  if (line == std::string_view::npos) return 0;
  const std::string_view kind = input.substr(0, line);
  const std::string_view message = input.substr(line + 1);
  (void)(fuzz::TakeAs<v1::SubmitJobRequest>(kind, "submit", message) || fuzz::TakeAs<v1::WorkerMessage>(kind, "worker", message) ||
         fuzz::TakeAs<v1::Blob>(kind, "blob", message));
  return 0;
}
