// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/simulation/effect.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "services/base/check.h"
#include "services/simulation/effect_settings.h"
#include "services/simulation/json_schema.h"
#include "services/simulation/mesh_file.h"
#include "services/simulation/shipped_effects.h"
#include "services/tasks/field_table.h"

namespace vorocast::simulation {
namespace {

using nlohmann::json;

constexpr std::uintmax_t kLargestFile = 2 << 20;  // with the meshes that it carries
constexpr int kDeepest = 32;                      // what the schema describes is nested far less

absl::StatusOr<std::string> ReadText(const std::filesystem::path& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return absl::NotFoundError(fmt::format("effect file {}: {}", path.string(), error.message()));
  if (size > kLargestFile)
    return absl::InvalidArgumentError(fmt::format("effect file {}: {} bytes, an effect has at most {}", path.string(), size, kLargestFile));
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file) return absl::UnavailableError(fmt::format("effect file {}: cannot be read", path.string()));
  return text;
}

absl::StatusOr<json> ParseEffectFile(std::string_view text, const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(json effect, ParseJson(text));
  RETURN_IF_ERROR(EmbedMeshFiles(effect, path.parent_path()));
  return NormaliseEffect(effect);
}

}  // namespace

std::vector<std::string> ShippedEffects() {
  std::vector<std::string> names;
  for (const EmbeddedFile& effect : EmbeddedEffects()) names.emplace_back(effect.name);
  return names;
}

absl::StatusOr<json> NormaliseEffect(const json& effect) {
  static const json schema = json::parse(EffectSchemaText());
  ASSIGN_OR_RETURN(json canonical, Canonicalise(schema, effect, "effect"));
  RETURN_IF_ERROR(EffectFromCanonicalJson(canonical).status());
  return canonical;
}

absl::StatusOr<json> ParseJson(std::string_view text) {
  if (text.size() > kLargestFile)
    return absl::InvalidArgumentError(fmt::format("effect: {} bytes, an effect has at most {}", text.size(), kLargestFile));
  try {
    json value = json::parse(text);
    // Copying and printing a value take as much stack as it is deep.
    if (!tasks::NestsWithin(value, kDeepest)) return absl::InvalidArgumentError(fmt::format("effect: it nests more than {} deep", kDeepest));
    return value;
  } catch (const json::exception& error) {
    return absl::InvalidArgumentError(fmt::format("effect: not valid JSON: {}", error.what()));
  }
}

absl::StatusOr<json> ParseEffect(std::string_view text) {
  ASSIGN_OR_RETURN(const json effect, ParseJson(text));
  return NormaliseEffect(effect);
}

absl::Status CheckSecondTake(const json& effect, bool has_second_take) {
  const bool morphs = effect.is_object() && effect.contains("morph") && effect["morph"].is_object();
  if (morphs == has_second_take) return absl::OkStatus();
  const std::string name = effect.is_object() ? effect.value("name", "") : "";
  if (morphs) {
    return absl::InvalidArgumentError(fmt::format(
        "effect \"{}\" turns the take into a second one, and none was given: name that take too (--onto FOLDER; onto_sequence_id)", name));
  }
  return absl::InvalidArgumentError(
      fmt::format("a second take was given, and {} has no use for it: choose an effect with a morph (--effect morph), or leave the second take out",
                  effect.is_object() ? fmt::format("effect \"{}\"", name) : "a job without an effect"));
}

absl::StatusOr<json> LoadEffect(const std::string& name_or_path) {
  for (const EmbeddedFile& effect : EmbeddedEffects()) {
    if (effect.name == name_or_path) return ParseEffect(effect.text);
  }
  std::error_code error;
  if (!std::filesystem::exists(name_or_path, error)) {
    return absl::NotFoundError(
        fmt::format("effect \"{}\": no such file, and none of the shipped effects ({})", name_or_path, fmt::join(ShippedEffects(), ", ")));
  }
  ASSIGN_OR_RETURN(const std::string text, ReadText(name_or_path));
  auto effect = ParseEffectFile(text, name_or_path);
  if (!effect.ok()) return base::Annotate(effect.status(), name_or_path);
  return effect;
}

}  // namespace vorocast::simulation
