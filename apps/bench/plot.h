// SPDX-License-Identifier: BSD-3-Clause
// Plots of benchmarks as SVG: text stays text, and the same figures give the same bytes.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "apps/bench/seed_table.h"

namespace holba {

struct PlotLine {
  std::string name;
  std::vector<std::array<double, 2>> points;  // x, y; left out where an axis cannot show it
};
struct PlotPanel {
  std::string title, x_label, y_label;
  std::vector<PlotLine> lines;
};
// Panels side by side with logarithmic axes; lines of one name have one colour in all of them.
std::string LogarithmicPlot(std::span<const PlotPanel> panels);

// A panel for each measure: for each row a dot of every case, a bar from the mean one deviation
// either way, and the mean as a number.
std::string DotPlot(const SeedTable& table);

// Positions of ticks on a linear axis: about `count` round numbers from low to high, low < high.
std::vector<double> RoundTicks(double low, double high, int count);

}  // namespace holba
