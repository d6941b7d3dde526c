// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/report/html.h"

namespace vorocast::report {

std::string Escape(std::string_view text) {
  std::string html;
  html.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      case '\'':
        html += "&#39;";
        break;
      default:
        if (static_cast<unsigned char>(c) >= 0x20 || c == '\n') html.push_back(c);
    }
  }
  return html;
}

}  // namespace vorocast::report
