// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/tasks/task.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include "services/base/check.h"
#include "services/tasks/field_table.h"
#include "services/tasks/options.h"

namespace vorocast::tasks {
namespace {

/// The template task of the longest take reads each frame's points and cells.
constexpr std::size_t kInputsMax = 2 * kFramesMax;
constexpr std::array<std::string_view, 10> kRoles = {"frame",  "template", "stretch", "guide",     "cells",
                                                     "window", "tracked",  "target",  "simulated", "picture"};

struct KindTraits {
  Kind kind;
  std::string_view name;
  int kernel_version;
  std::string_view extension;
};
constexpr KindTraits kTraits[] = {
    {Kind::kTessellate, "tessellate", 2, ".h5"}, {Kind::kTemplate, "template", 2, ".h5"}, {Kind::kStretch, "stretch", 2, ".h5"},
    {Kind::kGuide, "guide", 3, ".h5"},           {Kind::kTrack, "track", 2, ".h5"},       {Kind::kAssemble, "assemble", 2, ".h5"},
    {Kind::kSimulate, "simulate", 3, ".h5"},     {Kind::kSheet, "sheet", 4, ".png"},      {Kind::kRender, "render", 3, ".exr"},
    {Kind::kEncode, "encode", 1, ".mp4"},
};

const KindTraits& Traits(Kind kind) {
  const auto index = static_cast<std::size_t>(kind);
  VOROCAST_CHECK(index < std::size(kTraits) && kTraits[index].kind == kind);
  return kTraits[index];
}

/// Sorted keys, no spaces. Bytes that are not UTF-8 cannot come through parsing; if a program puts them in, they are replaced, not thrown on.
std::string CanonicalJson(const nlohmann::json& json) { return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace); }

template <typename Options>
absl::Status CheckOptions(const nlohmann::json& json) {
  Options options;
  return FromJson(json, options);
}

absl::Status CheckOptions(Kind kind, const nlohmann::json& json) {
  switch (kind) {
    case Kind::kTessellate:
      return CheckOptions<TessellateOptions>(json);
    case Kind::kTemplate:
      return CheckOptions<TemplateOptions>(json);
    case Kind::kStretch:
      return CheckOptions<StretchOptions>(json);
    case Kind::kGuide:
      return CheckOptions<GuideOptions>(json);
    case Kind::kTrack:
      return CheckOptions<TrackOptions>(json);
    case Kind::kAssemble:
      return CheckOptions<AssembleOptions>(json);
    case Kind::kSimulate:
      return CheckOptions<SimulateOptions>(json);
    case Kind::kSheet:
      return CheckOptions<SheetOptions>(json);
    case Kind::kRender:
      return CheckOptions<RenderOptions>(json);
    case Kind::kEncode:
      return CheckOptions<EncodeOptions>(json);
  }
  return absl::InvalidArgumentError("kind is unknown");
}

absl::Status Refuse(std::string_view field, std::string_view must) {
  return absl::InvalidArgumentError(fmt::format("{} is wrong or missing; it must be {}", field, must));
}

/// A dot and 1 to 8 lower-case letters or digits: always safe at the end of a path.
bool IsExtension(const nlohmann::json& json) {
  if (!json.is_string()) return false;
  const auto& text = json.get_ref<const std::string&>();
  return text.size() >= 2 && text.size() <= 9 && text[0] == '.' &&
         std::all_of(text.begin() + 1, text.end(), [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); });
}

absl::Status CheckFieldNames(const nlohmann::json& json, const std::string& place, std::initializer_list<std::string_view> known) {
  if (!json.is_object()) return Refuse(place, "an object");
  for (const auto& [name, value] : json.items()) {
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      return absl::InvalidArgumentError(fmt::format("{} has an unknown field; its fields are {}", place, fmt::join(known, ", ")));
    }
  }
  for (const std::string_view name : known) {
    if (!json.contains(name)) return Refuse(fmt::format("{}.{}", place, name), "there");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<base::Digest>> DigestOrNull(const nlohmann::json& json, const std::string& place) {
  if (json.is_null()) return std::nullopt;
  if (!json.is_string()) return Refuse(place, "64 lower-case hexadecimal digits, or null where there is none");
  absl::StatusOr<base::Digest> parsed = base::Digest::FromHex(json.get_ref<const std::string&>());
  if (!parsed.ok()) return base::Annotate(parsed.status(), place);
  return *parsed;
}

absl::StatusOr<Input> InputFromJson(const nlohmann::json& json, const std::string& place) {
  RETURN_IF_ERROR(CheckFieldNames(json, place, {"role", "frame", "source", "extension", "digest", "content"}));
  Input input;
  const nlohmann::json& role = json["role"];
  if (!role.is_string() || std::find(kRoles.begin(), kRoles.end(), role.get_ref<const std::string&>()) == kRoles.end()) {
    return Refuse(place + ".role", fmt::format("one of {}", fmt::join(kRoles, ", ")));
  }
  input.role = role.get<std::string>();

  const nlohmann::json& frame = json["frame"];
  if (!IsWholeIn(frame, -1, kFrameNumberMax)) {
    return Refuse(place + ".frame", fmt::format("a whole number from -1 to {}", kFrameNumberMax));
  }
  input.frame = frame.get<std::int32_t>();

  const nlohmann::json& source = json["source"];
  if (source != "blob" && source != "artifact") return Refuse(place + ".source", "\"blob\" or \"artifact\"");
  input.source = source == "blob" ? Input::Source::kBlob : Input::Source::kArtifact;

  if (!IsExtension(json["extension"])) return Refuse(place + ".extension", "a dot and 1 to 8 lower-case letters or digits");
  input.extension = json["extension"].get<std::string>();

  ASSIGN_OR_RETURN(input.digest, DigestOrNull(json["digest"], place + ".digest"));
  ASSIGN_OR_RETURN(input.content, DigestOrNull(json["content"], place + ".content"));
  return input;
}

nlohmann::json HexOrNull(const std::optional<base::Digest>& digest) { return digest ? nlohmann::json(digest->Hex()) : nlohmann::json(); }

nlohmann::json ToJson(const Input& input) {
  return {{"role", input.role},
          {"frame", input.frame},
          {"source", input.source == Input::Source::kBlob ? "blob" : "artifact"},
          {"extension", input.extension},
          {"digest", HexOrNull(input.digest)},
          {"content", HexOrNull(input.content)}};
}

}  // namespace

std::string_view Name(Kind kind) { return Traits(kind).name; }
int KernelVersion(Kind kind) { return Traits(kind).kernel_version; }
std::string_view Extension(Kind kind) { return Traits(kind).extension; }

absl::StatusOr<Kind> KindFromName(std::string_view name) {
  std::vector<std::string_view> names;
  for (const KindTraits& traits : kTraits) {
    if (traits.name == name) return traits.kind;
    names.push_back(traits.name);
  }
  return absl::InvalidArgumentError(fmt::format("there is no kind of task of that name; the kinds are {}", fmt::join(names, ", ")));
}

base::Digest TaskSpec::Key() const {
  base::Hasher hasher;
  hasher.UpdateField("vorocast task").UpdateField(Name(kind)).UpdateField(std::to_string(KernelVersion(kind))).UpdateField(CanonicalJson(options));
  hasher.UpdateField(std::to_string(inputs.size()));
  for (const Input& input : inputs) {
    hasher.UpdateField(input.role).UpdateField(std::to_string(input.frame));
    hasher.UpdateField(input.source == Input::Source::kBlob ? "blob" : "artifact").UpdateField(input.extension);
    hasher.UpdateField(input.digest ? input.digest->Hex() : "");
  }
  return hasher.Finish();
}

nlohmann::json ToJson(const TaskSpec& spec) {
  nlohmann::json inputs = nlohmann::json::array();
  for (const Input& input : spec.inputs) inputs.push_back(ToJson(input));
  return {{"kind", Name(spec.kind)}, {"options", spec.options}, {"inputs", std::move(inputs)}};
}

absl::StatusOr<TaskSpec> TaskSpecFromJson(const nlohmann::json& json) {
  RETURN_IF_ERROR(CheckFieldNames(json, "task", {"kind", "options", "inputs"}));
  TaskSpec spec;
  const nlohmann::json& kind = json["kind"];
  if (!kind.is_string()) return Refuse("kind", "a kind of task");
  ASSIGN_OR_RETURN(spec.kind, KindFromName(kind.get_ref<const std::string&>()));
  RETURN_IF_ERROR(CheckOptions(spec.kind, json["options"]));
  spec.options = json["options"];

  const nlohmann::json& inputs = json["inputs"];
  if (!inputs.is_array() || inputs.size() > kInputsMax) return Refuse("inputs", fmt::format("a list of at most {} inputs", kInputsMax));
  spec.inputs.reserve(inputs.size());
  for (const nlohmann::json& input : inputs) {
    ASSIGN_OR_RETURN(Input parsed, InputFromJson(input, fmt::format("inputs[{}]", spec.inputs.size())));
    spec.inputs.push_back(std::move(parsed));
  }
  return spec;
}

}  // namespace vorocast::tasks
