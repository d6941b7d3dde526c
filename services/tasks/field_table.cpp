// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/tasks/field_table.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include "services/tasks/options.h"

namespace vorocast::tasks {
namespace {

constexpr int kObjectDepthMax = 32;
constexpr std::size_t kObjectBytesMax = 1 << 20;

/// The value as people will see it in a message: short, and never failing on bytes that are not UTF-8.
std::string Excerpt(const nlohmann::json& value) {
  if (value.is_structured()) return value.is_array() ? "a list" : "an object";
  std::string text = value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 60) + "…";
  return text;
}

}  // namespace

bool NestsWithin(const nlohmann::json& json, int depth) {
  if (!json.is_structured()) return true;
  return depth > 0 && std::all_of(json.begin(), json.end(), [&](const nlohmann::json& child) { return NestsWithin(child, depth - 1); });
}

FieldReader::FieldReader(const nlohmann::json& json, std::string place) : json_(json), place_(std::move(place)) {
  if (json_.is_object()) return;
  const std::string whole = place_.empty() ? "the value" : place_.substr(0, place_.size() - 1);
  status_ = absl::InvalidArgumentError(fmt::format("{} is {}; it must be an object", whole, Excerpt(json_)));
}

const nlohmann::json* FieldReader::Find(const char* name) {
  known_.insert(name);
  if (!status_.ok()) return nullptr;
  const auto field = json_.find(name);
  return field == json_.end() ? nullptr : &*field;
}

void FieldReader::Refuse(const char* name, const nlohmann::json& value, const std::string& must) {
  status_ = absl::InvalidArgumentError(fmt::format("{}{} is {}; it must be {}", place_, name, Excerpt(value), must));
}

void FieldReader::Integer(const char* name, std::int32_t& value, std::int32_t low, std::int32_t high) {
  const nlohmann::json* field = Find(name);
  if (!field) return;
  if (!IsWholeIn(*field, low, high)) return Refuse(name, *field, fmt::format("a whole number from {} to {}", low, high));
  value = field->get<std::int32_t>();
}

void FieldReader::Integer(const char* name, std::uint64_t& value, std::uint64_t low, std::uint64_t high) {
  const nlohmann::json* field = Find(name);
  if (!field) return;
  if (!IsWholeIn(*field, low, high)) return Refuse(name, *field, fmt::format("a whole number from {} to {}", low, high));
  value = field->get<std::uint64_t>();
}

void FieldReader::Number(const char* name, double& value, double low, double high) {
  const nlohmann::json* field = Find(name);
  if (!field) return;
  if (!field->is_number() || !(field->get<double>() >= low && field->get<double>() <= high)) {
    return Refuse(name, *field, fmt::format("a number from {} to {}", low, high));
  }
  value = field->get<double>();
}

void FieldReader::Choice(const char* name, std::string& value, std::initializer_list<std::string_view> allowed) {
  const nlohmann::json* field = Find(name);
  if (!field) return;
  const auto is_it = [&](std::string_view choice) { return field->get_ref<const std::string&>() == choice; };
  if (!field->is_string() || std::none_of(allowed.begin(), allowed.end(), is_it)) {
    return Refuse(name, *field, fmt::format("one of \"{}\"", fmt::join(allowed, "\", \"")));
  }
  value = field->get<std::string>();
}

void FieldReader::Frames(const char* name, std::vector<std::int32_t>& value) {
  const nlohmann::json* field = Find(name);
  if (!field) return;
  const std::string must = fmt::format("a list of at most {} ascending frame numbers from 0 to {}", kFramesMax, kFrameNumberMax);
  if (!field->is_array() || field->size() > kFramesMax) return Refuse(name, *field, must);
  std::vector<std::int32_t> frames;
  frames.reserve(field->size());
  for (const nlohmann::json& frame : *field) {
    const bool ascends = IsWholeIn(frame, 0, kFrameNumberMax) && (frames.empty() || frame.get<std::int32_t>() > frames.back());
    if (!ascends) return Refuse(fmt::format("{}[{}]", name, frames.size()).c_str(), frame, "part of " + must);
    frames.push_back(frame.get<std::int32_t>());
  }
  value = std::move(frames);
}

void FieldReader::Object(const char* name, nlohmann::json& value) {
  const nlohmann::json* field = Find(name);
  if (!field) return;
  const bool small = field->is_object() && NestsWithin(*field, kObjectDepthMax) &&
                     field->dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).size() <= kObjectBytesMax;
  if (!small) return Refuse(name, *field, fmt::format("an object of at most {} bytes, nested at most {} deep", kObjectBytesMax, kObjectDepthMax));
  value = *field;
}

absl::Status FieldReader::Finish() {
  if (!status_.ok()) return status_;
  for (const auto& [name, value] : json_.items()) {
    if (!known_.contains(name)) {
      return absl::InvalidArgumentError(fmt::format("{}{} is unknown; the fields here are {}", place_, Excerpt(name), fmt::join(known_, ", ")));
    }
  }
  return absl::OkStatus();
}

}  // namespace vorocast::tasks
