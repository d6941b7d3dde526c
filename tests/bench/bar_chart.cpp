// SPDX-License-Identifier: AGPL-3.0-or-later
// Draws bars: bar_chart CHART.json OUT.png
//
//   {"title": "…", "panels": [{"title": "… (s)", "log": false, "groups": ["Voxels", …], "series": [{"name": "paper", "values": [0.9, null, …]}, …]}]}
//
// Panels stand one above the other; each group has one bar a series, its value above it. `null` leaves a bar out. All panels have the same series.
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "services/rendering/sheet.h"
#include "services/rendering/stroke_font.h"

namespace vorocast::bench {
namespace {

using geometry::Rgb8;

constexpr std::int32_t kWidth = 1120;
constexpr std::int32_t kPanelHeight = 330;
constexpr std::int32_t kHead = 90;  // title and legend
constexpr std::int32_t kLeft = 30;
constexpr std::int32_t kBarTop = 60;     // below a panel's top, room for its title and the values
constexpr std::int32_t kBarBottom = 50;  // above a panel's bottom, room for the groups' names
constexpr Rgb8 kInk = {40, 44, 52};
constexpr Rgb8 kFaint = {225, 228, 232};
constexpr std::array<Rgb8, 5> kColours = {{{150, 156, 166}, {58, 124, 189}, {230, 145, 56}, {92, 158, 96}, {170, 90, 150}}};

struct Panel {
  std::string title;
  bool log = false;
  std::vector<std::string> groups;
  std::vector<std::vector<std::optional<double>>> values;  // [series][groups]
};

struct Chart {
  std::string title;
  std::vector<std::string> series;
  std::vector<Panel> panels;
};

Chart ReadChart(const nlohmann::json& json) {
  Chart chart;
  chart.title = json.at("title");
  for (const nlohmann::json& one : json.at("panels")) {
    Panel panel{one.at("title"), one.at("log"), one.at("groups"), {}};
    chart.series.clear();
    for (const nlohmann::json& series : one.at("series")) {
      chart.series.push_back(series.at("name"));
      panel.values.emplace_back();
      for (const nlohmann::json& value : series.at("values")) {
        panel.values.back().push_back(value.is_null() ? std::nullopt : std::optional<double>(value.get<double>()));
      }
    }
    chart.panels.push_back(std::move(panel));
  }
  return chart;
}

void Fill(rendering::Image& image, double left, double top, double right, double bottom, const Rgb8& colour) {
  const auto inside = [](double x, std::int32_t end) { return std::clamp(static_cast<std::int32_t>(std::lround(x)), 0, end); };
  for (std::int32_t y = inside(top, image.height); y < inside(bottom, image.height); ++y) {
    for (std::int32_t x = inside(left, image.width); x < inside(right, image.width); ++x) {
      std::ranges::copy(colour, image.rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(y) * image.width + x));
    }
  }
}

void Centre(rendering::Image& image, double middle, double top, const std::string& text, double cap_height, double width_max) {
  const std::string fitting = rendering::FitText(text, cap_height, width_max);
  rendering::DrawText(image, middle - rendering::TextWidth(fitting, cap_height) / 2, top, fitting, {.cap_height = cap_height, .colour = kInk});
}

/// Three digits that matter.
std::string Figure(double value) {
  if (value >= 100) return fmt::format("{:.0f}", value);
  if (value >= 10) return fmt::format("{:.1f}", value);
  return fmt::format("{:.{}f}", value, value >= 1 ? 2 : 3);
}

/// From a value to the share of the panel's height that its bar has.
class Scale {
 public:
  explicit Scale(const Panel& panel) : log_(panel.log) {
    for (const auto& series : panel.values) {
      for (const std::optional<double>& value : series) {
        if (!value || !(*value > 0)) continue;
        high_ = std::max(high_, *value);
        low_ = low_ > 0 ? std::min(low_, *value) : *value;
      }
    }
  }
  double operator()(double value) const {
    if (!(high_ > 0) || !(value > 0)) return 0;
    if (!log_) return value / high_;
    // The least bar keeps a tenth of the height, so that it can be seen.
    return 0.1 + 0.9 * (high_ > low_ ? std::log(value / low_) / std::log(high_ / low_) : 1);
  }

 private:
  bool log_;
  double low_ = 0, high_ = 0;
};

void DrawPanel(rendering::Image& image, const Panel& panel, double top) {
  const Scale scale(panel);
  rendering::DrawText(image, kLeft, top, panel.title, {.cap_height = 11, .colour = kInk});
  const double bottom = top + kPanelHeight - kBarBottom;
  const double height = kPanelHeight - kBarBottom - kBarTop;
  Fill(image, kLeft, bottom, kWidth - kLeft, bottom + 1, kInk);
  const double group_width = (kWidth - 2.0 * kLeft) / static_cast<double>(panel.groups.size());
  const double bar_width = 0.86 * group_width / static_cast<double>(panel.values.size());
  for (std::size_t g = 0; g < panel.groups.size(); ++g) {
    const double left = kLeft + (static_cast<double>(g) + 0.07) * group_width;
    for (std::size_t s = 0; s < panel.values.size(); ++s) {
      const std::optional<double>& value = panel.values[s][g];
      if (!value) continue;
      const double from = left + static_cast<double>(s) * bar_width;
      const double bar_top = bottom - height * scale(*value);
      Fill(image, from + 2, bar_top, from + bar_width - 2, bottom, kColours[s % kColours.size()]);
      Centre(image, from + bar_width / 2, bar_top - 13, Figure(*value), 8, bar_width);
    }
    Centre(image, left + 0.43 * group_width, bottom + 12, panel.groups[g], 9, 0.97 * group_width);
    if (g > 0) Fill(image, left - 0.07 * group_width, top + 30, left - 0.07 * group_width + 1, bottom, kFaint);
  }
}

rendering::Image Draw(const Chart& chart) {
  rendering::Image image{kWidth, kHead + kPanelHeight * static_cast<std::int32_t>(chart.panels.size()), {}};
  image.rgb.assign(3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height), 255);
  rendering::DrawText(image, kLeft, 22, chart.title, {.cap_height = 14, .colour = kInk});
  double left = kLeft;
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    Fill(image, left, 54, left + 14, 68, kColours[s % kColours.size()]);
    rendering::DrawText(image, left + 22, 56, chart.series[s], {.cap_height = 10, .colour = kInk});
    left += 22 + rendering::TextWidth(chart.series[s], 10) + 36;
  }
  for (std::size_t p = 0; p < chart.panels.size(); ++p) DrawPanel(image, chart.panels[p], kHead + kPanelHeight * static_cast<double>(p));
  return image;
}

}  // namespace
}  // namespace vorocast::bench

int main(int argc, char** argv) {
  if (argc != 3) {
    fmt::print(stderr, "usage: bar_chart CHART.json OUT.png\n");
    return 2;
  }
  try {
    std::ifstream file(argv[1]);
    const auto status = vorocast::rendering::WritePng(argv[2], vorocast::bench::Draw(vorocast::bench::ReadChart(nlohmann::json::parse(file))));
    if (!status.ok()) fmt::print(stderr, "bar_chart: {}\n", std::string(status.message()));
    return status.ok() ? 0 : 1;
  } catch (const nlohmann::json::exception& error) {
    fmt::print(stderr, "bar_chart: {}: {}\n", argv[1], error.what());
    return 1;
  }
}
