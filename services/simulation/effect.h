// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "services/base/status.h"

/// An effect is what an artist writes: a JSON file whose schema is effects/effect.schema.json, explained in docs/effects.md. That schema is
/// what parses, so an unknown field, a wrong type or a value out of range is refused with INVALID_ARGUMENT naming the field's path and
/// what it may hold. The typed form that the simulation works with is services/simulation/effect_settings.h.
namespace vorocast::simulation {

/// The names of the shipped effects, sorted ("calm", "erosion", …).
std::vector<std::string> ShippedEffects();
/// `name_or_path`: a shipped name or a JSON file, whose meshes are read from beside it (mesh_file.h). Returns the whole effect as canonical JSON,
/// defaults filled in. NOT_FOUND when it is neither, with the names that ship.
absl::StatusOr<nlohmann::json> LoadEffect(const std::string& name_or_path);
/// The same for JSON already read. What a client sends passes through here before it is believed.
absl::StatusOr<nlohmann::json> NormaliseEffect(const nlohmann::json& effect);
/// The same for JSON text, as it comes over a wire.
absl::StatusOr<nlohmann::json> ParseEffect(std::string_view text);

/// JSON text from outside, of any kind. INVALID_ARGUMENT when it is too long, too deeply nested, or no JSON.
absl::StatusOr<nlohmann::json> ParseJson(std::string_view text);

/// Whether the effect (canonical, or null for none) and the number of takes fit each other: a morph needs a second take, and nothing else has a use
/// for one. INVALID_ARGUMENT says what to do.
absl::Status CheckSecondTake(const nlohmann::json& canonical_effect, bool has_second_take);

}  // namespace vorocast::simulation
