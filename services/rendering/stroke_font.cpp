// SPDX-License-Identifier: AGPL-3.0-or-later
#include "services/rendering/stroke_font.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace vorocast::rendering {
namespace {

/// Strokes of the characters 32 to 126, separated by blanks; a stroke is a chain of points, two digits each: x from 0 (left) to 4, y from 0
/// (top of a capital) over 2 (top of a small letter) and 6 (base line) to 8 (end of a descender).
constexpr std::array<std::string_view, 95> kGlyphs = {
    "",                                       // blank
    "2024 2626",                              // !
    "1012 3032",                              // "
    "1016 3036 0242 0444",                    // #
    "413010010213334445361605 2026",          // $
    "4006 0010110100 3545463635",             // %
    "4612112030310405162644",                 // &
    "2022",                                   // '
    "30212536",                               // (
    "10212516",                               // )
    "2125 0244 0442",                         // *
    "2125 0343",                              // +
    "2617",                                   // ,
    "1333",                                   // -
    "2626",                                   // .
    "4006",                                   // /
    "102031352616050110",                     // 0
    "112026 1636",                            // 1
    "0110203132050636",                       // 2
    "01102031322313 233435261605",            // 3
    "26200434",                               // 4
    "300002223335261605",                     // 5
    "312010010516263534231304",               // 6
    "00303116",                               // 7
    "102031322313020110 132334352616050413",  // 8
    "051626353120100102132332",               // 9
    "2222 2626",                              // :
    "2222 2617",                              // ;
    "311335",                                 // <
    "0232 0434",                              // =
    "113315",                                 // >
    "01102031322324 2626",                    // ?
    "343212144441301001051646",               // @
    "062046 1434",                            // A
    "003041423303 3344453606 0006",           // B
    "4130100105163645",                       // C
    "00063645413000",                         // D
    "30000636 0323",                          // E
    "300006 0323",                            // F
    "41301001051636454323",                   // G
    "0006 4046 0343",                         // H
    "2026",                                   // I
    "3035261605",                             // J
    "0006 4004 1346",                         // K
    "000636",                                 // L
    "0600234046",                             // M
    "06004640",                               // N
    "103041453616050110",                     // O
    "06003041423303",                         // P
    "103041453616050110 2446",                // Q
    "06003041423303 2346",                    // R
    "413010010213334445361605",               // S
    "0040 2026",                              // T
    "000516364540",                           // U
    "002640",                                 // V
    "0016223640",                             // W
    "0046 4006",                              // X
    "002340 2326",                            // Y
    "00400646",                               // Z
    "30202636",                               // [
    "0046",                                   // backslash
    "10202616",                               // ]
    "122032",                                 // ^
    "0747",                                   // _
    "1021",                                   // `
    "3322120305162635 3236",                  // a
    "0006 0312223335261605",                  // b
    "3322120305162635",                       // c
    "3322120305162635 3036",                  // d
    "04343322120305162635",                   // e
    "30201116 0222",                          // f
    "3322120305162635 3237281807",            // g
    "0006 0312223336",                        // h
    "2226 2020",                              // i
    "222718 2020",                            // j
    "0006 3205 1436",                         // k
    "202536",                                 // l
    "0206 03122326 23324346",                 // m
    "0206 0312223336",                        // n
    "122233352616050312",                     // o
    "0208 0312223335261605",                  // p
    "3322120305162635 3238",                  // q
    "0206 031222",                            // r
    "3212031424352606",                       // s
    "10152636 0232",                          // t
    "0205162635 3236",                        // u
    "022642",                                 // v
    "0216233642",                             // w
    "0236 3206",                              // x
    "0226 4218",                              // y
    "02320636",                               // z
    "30212213242536",                         // {
    "2027",                                   // |
    "10212233242516",                         // }
    "04132433",                               // ~
};

/// In the glyphs' units, of which a capital has six.
constexpr double kUnitsPerCapital = 6;
constexpr double kLetterGap = 1.7;
constexpr double kBlankWidth = 2.2;
constexpr double kStrokeWidth = 0.8;

struct Segment {
  double x0, y0, x1, y1;
};

struct Glyph {
  std::vector<Segment> segments;  // from the left edge of the glyph
  double width = kBlankWidth;
};

std::string_view StrokesOf(char character) { return kGlyphs[static_cast<std::size_t>(character - ' ')]; }

Glyph GlyphOf(char character) {
  const std::string_view strokes = StrokesOf(character);
  Glyph glyph;
  if (strokes.empty()) return glyph;
  const auto digit = [&](std::size_t i) { return static_cast<double>(strokes[i] - '0'); };
  double left = 9;
  double right = 0;
  for (std::size_t i = 0; i < strokes.size(); i += strokes[i] == ' ' ? 1 : 2) {
    if (strokes[i] == ' ') continue;
    left = std::min(left, digit(i));
    right = std::max(right, digit(i));
  }
  // Digits all take the same width, so that numbers stand still from one picture to the next.
  if (character >= '0' && character <= '9') left = 0, right = 3;
  glyph.width = right - left;
  for (std::size_t i = 0; i + 3 < strokes.size(); i += 2) {
    if (strokes[i] == ' ') ++i;
    if (i + 2 >= strokes.size() || strokes[i + 2] == ' ') continue;
    glyph.segments.push_back({digit(i) - left, digit(i + 1), digit(i + 2) - left, digit(i + 3)});
  }
  return glyph;
}

/// One printable character for each code point of UTF-8.
std::string Printable(std::string_view text) {
  std::string printable;
  for (char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xc0) == 0x80) continue;  // inside a code point
    printable.push_back(byte >= 32 && byte < 127 ? c : '?');
  }
  return printable;
}

double Distance(const Segment& s, double x, double y) {
  const double dx = s.x1 - s.x0;
  const double dy = s.y1 - s.y0;
  const double squared = dx * dx + dy * dy;
  const double t = squared > 0 ? std::clamp(((x - s.x0) * dx + (y - s.y0) * dy) / squared, 0.0, 1.0) : 0;
  return std::hypot(x - s.x0 - t * dx, y - s.y0 - t * dy);
}

void DrawGlyph(Image& image, double left, double top, const Glyph& glyph, const TextStyle& style) {
  const double unit = style.cap_height / kUnitsPerCapital;
  const auto first_column = std::max(0, static_cast<int>(std::floor(left - unit)));
  const auto last_column = std::min(image.width - 1, static_cast<int>(std::ceil(left + (glyph.width + 1) * unit)));
  const auto first_row = std::max(0, static_cast<int>(std::floor(top - unit)));
  const auto last_row = std::min(image.height - 1, static_cast<int>(std::ceil(top + 9 * unit)));
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first_column; column <= last_column; ++column) {
      double nearest = 1e9;
      for (const Segment& s : glyph.segments) nearest = std::min(nearest, Distance(s, (column + 0.5 - left) / unit, (row + 0.5 - top) / unit));
      const double coverage = std::clamp((kStrokeWidth / 2 - nearest) * unit + 0.5, 0.0, 1.0);
      if (coverage <= 0) continue;
      std::uint8_t* pixel =
          &image.rgb[3 * (static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(column))];
      for (std::size_t i = 0; i < 3; ++i) pixel[i] = static_cast<std::uint8_t>(std::lround(pixel[i] + coverage * (style.colour[i] - pixel[i])));
    }
  }
}

}  // namespace

double TextWidth(std::string_view text, double cap_height) {
  double units = 0;
  const std::string printable = Printable(text);
  for (char c : printable) units += GlyphOf(c).width + kLetterGap;
  return printable.empty() ? 0 : (units - kLetterGap) * cap_height / kUnitsPerCapital;
}

std::string FitText(std::string_view text, double cap_height, double width_max) {
  std::string fitting = Printable(text);
  if (TextWidth(fitting, cap_height) <= width_max) return fitting;
  while (!fitting.empty() && TextWidth(fitting + "...", cap_height) > width_max) fitting.pop_back();
  return fitting.empty() ? "" : fitting + "...";
}

void DrawText(Image& image, double left, double top, std::string_view text, const TextStyle& style) {
  for (char c : Printable(text)) {
    const Glyph glyph = GlyphOf(c);
    DrawGlyph(image, left, top, glyph, style);
    left += (glyph.width + kLetterGap) * style.cap_height / kUnitsPerCapital;
  }
}

}  // namespace vorocast::rendering
