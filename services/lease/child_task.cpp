// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/lease/child_task.h"

#include <nlohmann/json.hpp>

namespace vorocast::lease {
namespace {

using nlohmann::json;

/// One line; bytes that are not UTF-8 are replaced.
std::string Line(const json& value) { return value.dump(-1, ' ', false, json::error_handler_t::replace); }

std::string ValidUtf8(std::string_view text) { return json::parse(Line(json(std::string(text)))).get<std::string>(); }

/// The field, or null. A reference: copying a value recurses as deep as what was printed nests.
const json& Field(const json& object, const char* name) {
  static const json kNone;
  const auto field = object.find(name);
  return field == object.end() ? kNone : *field;
}

bool IsContinuation(char byte) { return (static_cast<unsigned char>(byte) & 0xC0) == 0x80; }

}  // namespace

std::string Encode(const ChildTask& task) {
  return Line({{"spec", ToJson(task.spec)},
               {"store_root", task.store_root.string()},
               {"output", task.output.string()},
               {"memory_limit", task.memory_limit},
               {"worker_pid", task.worker_pid}});
}

absl::StatusOr<ChildTask> DecodeChildTask(std::string_view text) {
  const json value = json::parse(text, nullptr, false);
  const bool right = value.is_object() && value.contains("spec") && Field(value, "store_root").is_string() && Field(value, "output").is_string() &&
                     Field(value, "memory_limit").is_number_integer() && Field(value, "worker_pid").is_number_integer();
  if (!right) return absl::InternalError("standard input does not hold a task; this command is for workers, which write one there");
  ChildTask task;
  ASSIGN_OR_RETURN(task.spec, tasks::TaskSpecFromJson(value["spec"]));
  task.store_root = value["store_root"].get<std::string>();
  task.output = value["output"].get<std::string>();
  task.memory_limit = value["memory_limit"].get<std::int64_t>();
  task.worker_pid = value["worker_pid"].get<std::int64_t>();
  return task;
}

std::string EncodeProgress(double fraction) { return Line({{"progress", fraction}}); }

std::string EncodeOutcome(const absl::Status& status) {
  const absl::string_view message = status.message();
  return Line({{"code", status.raw_code()}, {"message", TextForPeople({message.data(), message.size()}, kMessageBytesMax)}});
}

ChildLine DecodeChildLine(std::string_view line) {
  ChildLine decoded;
  const json value = json::parse(line, nullptr, false);
  if (!value.is_object()) return decoded;
  if (const json& progress = Field(value, "progress"); progress.is_number()) decoded.progress = progress.get<double>();
  const json& code = Field(value, "code");
  const json& message = Field(value, "message");
  if (code.is_number_integer() && message.is_string()) {
    decoded.outcome = absl::Status(static_cast<absl::StatusCode>(code.get<int>()), message.get<std::string>());
  }
  return decoded;
}

std::string TextForPeople(std::string_view text, std::size_t bytes_max) {
  std::string valid = ValidUtf8(text);
  if (valid.size() <= bytes_max) return valid;
  std::size_t end = bytes_max - std::string_view("…").size();
  while (end > 0 && IsContinuation(valid[end])) --end;
  return valid.substr(0, end) + "…";
}

std::string TailForPeople(std::string_view text, std::size_t bytes_max) {
  std::string valid = ValidUtf8(text);
  while (!valid.empty() && (valid.back() == '\n' || valid.back() == ' ')) valid.pop_back();
  if (valid.size() <= bytes_max) return valid;
  std::size_t begin = valid.size() - bytes_max + std::string_view("…").size();
  while (begin < valid.size() && IsContinuation(valid[begin])) ++begin;
  return "…" + valid.substr(begin);
}

}  // namespace vorocast::lease
