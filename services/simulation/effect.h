// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "services/base/status.h"

namespace vorocast::simulation {

/// An effect as an artist writes it: a JSON file whose schema is effects/effect.schema.json. Parsing fills in defaults and refuses an
/// unknown field, a wrong type or a value out of range with INVALID_ARGUMENT naming the field's path and what it may hold.
class Effect;

/// The names of the shipped effects, sorted ("calm", "pendulum", "release").
std::vector<std::string> ShippedEffects();
/// `name_or_path`: a shipped name or a JSON file. Returns the whole effect as canonical JSON, defaults filled in.
absl::StatusOr<nlohmann::json> LoadEffect(const std::string& name_or_path);
/// The same for JSON already read. What a client sends passes through here before it is believed.
absl::StatusOr<nlohmann::json> NormaliseEffect(const nlohmann::json& effect);

}  // namespace vorocast::simulation
