// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "holba/base/check.h"

namespace holba {
namespace {

constexpr const char* kColours[] = {"#1b6ca8", "#c44e52", "#dd8452", "#55a868",
                                    "#8172b3", "#937860", "#64b5cd", "#777777"};
constexpr const char* kGrid = "#dddddd";
constexpr const char* kInk = "#222222";
// Of a letter at 11 px, about: what a label needs.
constexpr double kLetterPx = 6.2;

const char* ColourOf(size_t i) { return kColours[i % std::size(kColours)]; }

std::string SvgText(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

class Svg {
 public:
  Svg(double width, double height)
      : text_(fmt::format(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
            "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"sans-serif\" font-size=\"11\" "
            "fill=\"{2}\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
            width, height, kInk)) {}

  void Line(double x1, double y1, double x2, double y2, const char* colour, double width) {
    text_ += fmt::format(
        "<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\" stroke-width=\"{:g}\"/>\n", x1, y1,
        x2, y2, colour, width);
  }
  void Path(const std::vector<std::array<double, 2>>& points, const char* colour) {
    if (points.empty()) return;
    text_ += "<path d=\"";
    for (size_t i = 0; i < points.size(); ++i)
      text_ += fmt::format("{}{:.1f} {:.1f}", i == 0 ? "M" : "L", points[i][0], points[i][1]);
    text_ += fmt::format("\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>\n", colour);
  }
  void Dot(double x, double y, double radius, const char* colour, double opacity) {
    text_ += fmt::format(
        "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:g}\" fill=\"{}\" fill-opacity=\"{:g}\"/>\n", x,
        y, radius, colour, opacity);
  }
  // `anchor`: "start", "middle" or "end".
  void Text(double x, double y, const char* anchor, const std::string& text, int size = 11) {
    text_ += fmt::format(
        "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" font-size=\"{}\">{}</text>\n", x, y,
        anchor, size, SvgText(text));
  }
  void Vertical(double x, double y, const std::string& text) {
    text_ += fmt::format(
        "<text x=\"{0:.1f}\" y=\"{1:.1f}\" text-anchor=\"middle\" "
        "transform=\"rotate(-90 {0:.1f} {1:.1f})\">{2}</text>\n",
        x, y, SvgText(text));
  }
  std::string Finish() && { return text_ + "</svg>\n"; }

 private:
  std::string text_;
};

struct Interval {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void Take(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
  bool IsEmpty() const { return low > high; }
};

// A logarithmic scale onto pixels.
struct LogScale {
  Interval of;
  double from_px, to_px;

  double operator()(double x) const {
    return from_px + (to_px - from_px) * std::log(x / of.low) / std::log(of.high / of.low);
  }
};

// 1, 2 and 5 times powers of ten.
std::vector<double> LogTicks(const Interval& of) {
  std::vector<double> ticks;
  for (double power = std::pow(10.0, std::floor(std::log10(of.low))); power <= of.high;
       power *= 10.0) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      if (factor * power >= of.low && factor * power <= of.high) ticks.push_back(factor * power);
    }
  }
  return ticks;
}

bool CanBeShown(const std::array<double, 2>& p) {
  return p[0] > 0.0 && p[1] > 0.0 && std::isfinite(p[0]) && std::isfinite(p[1]);
}

void DrawPanel(const PlotPanel& panel, const std::vector<std::string>& names, double left,
               double right, double top, double bottom, Svg* svg) {
  svg->Text(0.5 * (left + right), top - 10, "middle", panel.title, 12);
  svg->Text(0.5 * (left + right), bottom + 34, "middle", panel.x_label);
  svg->Vertical(left - 42, 0.5 * (top + bottom), panel.y_label);
  Interval x, y;
  for (const PlotLine& line : panel.lines) {
    for (const auto& p : line.points) {
      if (!CanBeShown(p)) continue;
      x.Take(p[0]);
      y.Take(p[1]);
    }
  }
  if (x.IsEmpty()) return;
  constexpr double kMargin = 1.15;  // so that no dot is on the frame
  const LogScale to_x{{x.low / kMargin, x.high * kMargin}, left, right};
  const LogScale to_y{{y.low / kMargin, y.high * kMargin}, bottom, top};
  for (const double tick : LogTicks(to_x.of)) {
    svg->Line(to_x(tick), top, to_x(tick), bottom, kGrid, 0.6);
    svg->Text(to_x(tick), bottom + 16, "middle", fmt::format("{:g}", tick));
  }
  for (const double tick : LogTicks(to_y.of)) {
    svg->Line(left, to_y(tick), right, to_y(tick), kGrid, 0.6);
    svg->Text(left - 5, to_y(tick) + 4, "end", fmt::format("{:g}", tick));
  }
  for (const PlotLine& line : panel.lines) {
    const char* colour = ColourOf(
        static_cast<size_t>(std::find(names.begin(), names.end(), line.name) - names.begin()));
    std::vector<std::array<double, 2>> points;
    for (const auto& p : line.points)
      if (CanBeShown(p)) points.push_back({to_x(p[0]), to_y(p[1])});
    svg->Path(points, colour);
    for (const auto& p : points) svg->Dot(p[0], p[1], 3, colour, 1);
  }
}

}  // namespace

std::string LogarithmicPlot(std::span<const PlotPanel> panels) {
  constexpr double kPanel = 330, kLeft = 62, kTop = 34, kHeight = 260, kBelow = 44;
  std::vector<std::string> names;
  for (const PlotPanel& panel : panels) {
    for (const PlotLine& line : panel.lines)
      if (std::find(names.begin(), names.end(), line.name) == names.end())
        names.push_back(line.name);
  }
  Svg svg(static_cast<double>(panels.size()) * (kPanel + kLeft) + 20, kTop + kHeight + kBelow + 24);
  for (size_t i = 0; i < panels.size(); ++i) {
    const double left = static_cast<double>(i) * (kPanel + kLeft) + kLeft;
    DrawPanel(panels[i], names, left, left + kPanel - 10, kTop, kTop + kHeight, &svg);
  }
  double x = kLeft;
  for (size_t i = 0; i < names.size(); ++i) {
    svg.Dot(x, kTop + kHeight + kBelow + 10, 4, ColourOf(i), 1);
    svg.Text(x + 8, kTop + kHeight + kBelow + 14, "start", names[i]);
    x += 28 + kLetterPx * static_cast<double>(names[i].size());
  }
  return std::move(svg).Finish();
}

std::vector<double> RoundTicks(double low, double high, int count) {
  HOLBA_CHECK(low < high && count > 0);
  const double raw = (high - low) / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  double step = 10.0 * power;
  for (const double factor : {5.0, 2.0, 1.0})
    if (factor * power >= raw) step = factor * power;
  std::vector<double> ticks;
  // Whole numbers of steps, so that 0 is 0.
  for (double i = std::ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i += 1.0)
    ticks.push_back(i * step);
  return ticks;
}

std::string DotPlot(const SeedTable& table) {
  constexpr double kTop = 30, kRow = 22, kBelow = 26, kPanel = 190, kGap = 24, kNumber = 52;
  size_t longest = 0;
  for (const std::string& row : table.rows) longest = std::max(longest, row.size());
  const double left = 14 + kLetterPx * static_cast<double>(longest);
  const double bottom = kTop + kRow * static_cast<double>(table.rows.size());
  Svg svg(left + static_cast<double>(table.measures.size()) * (kPanel + kNumber + kGap),
          bottom + kBelow);
  const auto y_of = [&](size_t row) { return kTop + kRow * (static_cast<double>(row) + 0.5); };
  for (size_t r = 0; r < table.rows.size(); ++r)
    svg.Text(left - 8, y_of(r) + 4, "end", table.rows[r]);
  for (size_t m = 0; m < table.measures.size(); ++m) {
    const double begin = left + static_cast<double>(m) * (kPanel + kNumber + kGap);
    svg.Text(begin + 0.5 * kPanel, kTop - 12, "middle", table.measures[m].name, 12);
    Interval range;
    for (size_t r = 0; r < table.rows.size(); ++r) {
      for (const double value : table.values[r][m])
        if (std::isfinite(value)) range.Take(value);
    }
    if (range.IsEmpty()) continue;
    // Of equal values an axis about them.
    const double margin = range.low < range.high ? 0.06 * (range.high - range.low)
                                                 : std::max(1e-3, 0.1 * std::abs(range.low));
    const double low = range.low - margin, high = range.high + margin;
    const auto x_of = [&](double value) { return begin + kPanel * (value - low) / (high - low); };
    for (const double tick : RoundTicks(low, high, 4)) {
      svg.Line(x_of(tick), kTop, x_of(tick), bottom, kGrid, 0.6);
      svg.Text(x_of(tick), bottom + 15, "middle", fmt::format("{:g}", tick));
    }
    for (size_t r = 0; r < table.rows.size(); ++r) {
      const auto spread = SpreadOf(table.values[r][m]);
      if (!spread) continue;
      svg.Line(x_of(std::max(low, spread->mean - spread->deviation)), y_of(r),
               x_of(std::min(high, spread->mean + spread->deviation)), y_of(r), ColourOf(r), 1.6);
      for (const double value : table.values[r][m])
        if (std::isfinite(value)) svg.Dot(x_of(value), y_of(r), 2.5, ColourOf(r), 0.5);
      svg.Dot(x_of(spread->mean), y_of(r), 4.5, ColourOf(r), 1);
      svg.Text(begin + kPanel + 6, y_of(r) + 4, "start",
               fmt::format("{:.{}f}", spread->mean, table.measures[m].digits));
    }
  }
  return std::move(svg).Finish();
}

}  // namespace holba
