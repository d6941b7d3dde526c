// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "services/base/status.h"

namespace vorocast::simulation {

/// Checks `value` against a JSON Schema and returns it in canonical form: every default filled in, every "number" a floating-point number.
/// Parsing and schema cannot drift apart, because the schema is what parses.
///
/// Understands the part of draft-07 that effects/effect.schema.json is written in: type (object, array, string, number, boolean),
/// integer, properties, required, additionalProperties false, items, minItems, maxItems, minLength, maxLength, minimum, maximum,
/// exclusiveMinimum, enum, const, default, $ref into #/definitions, allOf of one $ref (so that it may have a default), anyOf of a const text
/// and something else, anyOf of a number or a list of numbers and key frames of it (a list of objects with t and value; t must ascend), and
/// oneOf of objects told apart by a property that is const in each. A schema written otherwise is a programmer's error.
/// INVALID_ARGUMENT names the field's path below `subject` and what it may hold: `effect: ground.friction: -1 is not a number from 0 to 10`.
absl::StatusOr<nlohmann::json> Canonicalise(const nlohmann::json& schema, const nlohmann::json& value, const std::string& subject);

}  // namespace vorocast::simulation
