// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_leave_one_out.h"

#include <algorithm>
#include <cmath>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/estimation/lines/line_uncertainty.h"

namespace holba {
namespace {

struct OfLine {
  std::vector<double> distances_px;
  size_t no_fit = 0;
  bool too_few = false;
};

OfLine LeaveOut(const Reconstruction& model, const ViewMap& views_of_model, const Line3D& line,
                size_t min_images) {
  OfLine result;
  const std::vector<LineSupport> supports = SupportsOfLine(model, views_of_model, line);
  std::vector<uint32_t> views;
  for (const LineSupport& s : supports) {
    if (std::find(views.begin(), views.end(), s.view) == views.end()) views.push_back(s.view);
  }
  if (views.size() < min_images) {
    result.too_few = true;
    return result;
  }
  const LineWithExtent placed = WithExtent(line);
  std::vector<LineSupport> others;
  for (uint32_t view : views) {
    others.clear();
    for (const LineSupport& s : supports) {
      if (s.view != view) others.push_back(s);
    }
    AnchoredLine fitted = placed.line;
    if (!FitLine(others, LinePrior(), kSegmentCauchyPx, &fitted)) {
      ++result.no_fit;
      continue;
    }
    for (const LineSupport& s : supports) {
      if (s.view != view) continue;
      const std::optional<Eigen::Vector3d> image = s.Image(fitted);
      if (!image) {
        ++result.no_fit;
        continue;
      }
      result.distances_px.push_back(0.5 * (std::abs(image->dot(s.start.homogeneous())) +
                                           std::abs(image->dot(s.end.homogeneous()))));
    }
  }
  return result;
}

}  // namespace

LeaveOneOutReport LeaveOneOut(const Reconstruction& model, int min_images, int num_threads) {
  HOLBA_CHECK(min_images >= 3);
  std::vector<const Line3D*> lines;
  for (const auto& [id, line] : model.lines3D) lines.push_back(&line);
  const ViewMap views(model);
  std::vector<OfLine> of_line(lines.size());
  ParallelTasks(num_threads, lines.size(), [&](size_t i) {
    of_line[i] = LeaveOut(model, views, *lines[i], static_cast<size_t>(min_images));
  });
  LeaveOneOutReport report;
  for (const OfLine& line : of_line) {
    report.too_few_images += line.too_few;
    report.no_fit += line.no_fit;
    report.num_lines += !line.distances_px.empty();
    report.distances_px.insert(report.distances_px.end(), line.distances_px.begin(),
                               line.distances_px.end());
  }
  if (report.distances_px.empty()) return report;
  std::vector<double> sorted = report.distances_px;
  std::sort(sorted.begin(), sorted.end());
  const size_t n = sorted.size();
  report.median_px = 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]);
  const auto below = [&](double x) {
    return static_cast<double>(std::lower_bound(sorted.begin(), sorted.end(), x) - sorted.begin()) /
           n;
  };
  report.share_below_1_px = below(1.0);
  report.share_above_3_px = 1.0 - below(std::nextafter(3.0, 4.0));
  return report;
}

}  // namespace holba
