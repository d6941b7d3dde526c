// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <span>
#include <string_view>

namespace vorocast::simulation {

/// A file of effects/ as it was when the program was built: carried inside, so that the program works from anywhere.
struct EmbeddedFile {
  std::string_view name;  // without its extension
  std::string_view text;
};

/// The shipped effects, sorted by name (CMakeLists.txt writes the source of these two).
std::span<const EmbeddedFile> EmbeddedEffects();
/// effects/effect.schema.json.
std::string_view EffectSchemaText();

}  // namespace vorocast::simulation
