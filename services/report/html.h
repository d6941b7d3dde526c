// SPDX-License-Identifier: AGPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>

namespace vorocast::report {

/// Text from users, files and workers as HTML text or a quoted attribute's value: nothing in it can end the element or begin another. Control
/// characters but newlines are left out.
std::string Escape(std::string_view text);

}  // namespace vorocast::report
