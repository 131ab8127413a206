// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/group_filter.h"

#include <algorithm>
#include <optional>

#include "holba/base/threads.h"
#include "holba/robust/median.h"

namespace holba {

MemberTest TestMembers(const GroupType& type, const std::vector<double>& residuals,
                       const MemberOptions& options) {
  MemberTest test;
  test.is_inlier.assign(residuals.size(), false);
  if (residuals.empty()) return test;
  const double median = Median(residuals);
  const double keep = type.IsParallelism() ? options.keep_deg : options.keep_px;
  test.limit = std::min(std::max(options.max_mads * median, keep), options.fit.Limit(type));
  for (size_t i = 0; i < residuals.size(); ++i) {
    test.is_inlier[i] = residuals[i] <= test.limit;
    test.num_inliers += test.is_inlier[i];
  }
  return test;
}

const char* FaultOfSupport(const GroupType& type, size_t num_points, size_t num_lines,
                           size_t num_members, const MemberOptions& options) {
  const size_t num_inliers = num_points + num_lines;
  if (num_inliers < static_cast<size_t>(options.min_inliers)) return "few inliers";
  const auto unknowns = static_cast<size_t>(type.manifold->tangent);
  if (unknowns > 3 && num_points + 2 * num_lines <= unknowns) return "few inliers";
  if (static_cast<double>(num_inliers) <
      options.min_inlier_ratio * static_cast<double>(num_members)) {
    return "small share of inliers";
  }
  return nullptr;
}

MemberReport UpdateMembers(const MemberOptions& options, Reconstruction* model) {
  // The look-up remembers what it found, so that it must be done before the threads start.
  FeatureLookup lookup(*model);
  std::vector<GroupFeatures> features;
  for (const auto& [id, group] : model->groups3D) {
    features.push_back(lookup.Find(*group.type, group.point3D_ids, group.line3D_ids));
  }
  struct Result {
    std::optional<GroupFit> fit;
    MemberTest test;
  };
  std::vector<Result> results(features.size());
  ParallelTasks(options.num_threads, results.size(), [&](size_t k) {
    const auto& [id, group] = *(model->groups3D.begin() + static_cast<std::ptrdiff_t>(k));
    const GroupType& type = *group.type;
    GroupFitOptions fit_options = options.fit;
    fit_options.seed += id;
    double start[kMaxGroupParams];
    const bool has_start = type.from_file(group.params.data(), start);
    Result& result = results[k];
    result.fit = FitGroup(type, features[k], fit_options, has_start ? start : nullptr);
    if (!result.fit) return;
    result.test = TestMembers(type, result.fit->residuals, options);
    // The final parameters are those of the members that stay.
    GroupFeatures kept;
    for (size_t i = 0; i < features[k].points.size(); ++i) {
      if (result.test.is_inlier[i]) kept.points.push_back(features[k].points[i]);
    }
    for (size_t i = 0; i < features[k].lines.size(); ++i) {
      if (result.test.is_inlier[features[k].points.size() + i]) {
        kept.lines.push_back(features[k].lines[i]);
      }
    }
    if (const auto g = FitAll(type, kept)) {
      const GroupFit refitted = EvaluateGroup(type, g->data(), kept, fit_options.Limit(type));
      if (refitted.num_inliers == kept.size()) result.fit->g = *g;
    }
  });

  MemberReport report;
  std::set<group3D_t> removed;
  for (size_t k = 0; k < results.size(); ++k) {
    auto& [id, group] = *(model->groups3D.begin() + static_cast<std::ptrdiff_t>(k));
    const std::string name(group.type->name);
    const GroupFeatures& known = features[k];
    const auto count = [&](const std::string& what, size_t number) {
      if (number > 0) report.dropped[name + " " + what] += number;
    };
    count("point: not in the model", group.point3D_ids.size() - known.points.size());
    count("line: not in the model", group.line3D_ids.size() - known.lines.size());
    const Result& result = results[k];
    size_t num_points = 0;
    for (size_t i = 0; result.fit && i < known.points.size(); ++i) {
      num_points += result.test.is_inlier[i];
    }
    const char* fault =
        result.fit ? FaultOfSupport(*group.type, num_points, result.test.num_inliers - num_points,
                                    known.size(), options)
                   : "no parameters fit";
    if (fault) {
      count(std::string("group: ") + fault, 1);
      removed.insert(id);
      continue;
    }
    group.params = result.fit->FileParams(*group.type);
    std::vector<point3D_t> point3D_ids;
    std::vector<line3D_t> line3D_ids;
    for (size_t i = 0; i < known.points.size(); ++i) {
      if (result.test.is_inlier[i]) point3D_ids.push_back(known.point_ids[i]);
    }
    for (size_t i = 0; i < known.lines.size(); ++i) {
      if (result.test.is_inlier[known.points.size() + i]) line3D_ids.push_back(known.line_ids[i]);
    }
    model->SetMembers(id, std::move(point3D_ids), std::move(line3D_ids));
    count("point: beyond the limit", known.points.size() - group.point3D_ids.size());
    count("line: beyond the limit", known.lines.size() - group.line3D_ids.size());
    ++report.groups;
    report.points += group.point3D_ids.size();
    report.lines += group.line3D_ids.size();
  }
  model->DeleteGroups3D([&](group3D_t id, const Group3D&) { return removed.contains(id); });
  return report;
}

void MemberOptions::Describe(OptionTable* table) const {
  table->Section("Members");
  table->Field("max_error_px", &fit.max_error_px, GreaterThan(0),
               "Farthest from its group that a member may be, in pixels at its depth.");
  table->Field("max_angle_deg", &fit.max_angle_deg, Between(0, 90),
               "Widest angle between a line and its vanishing point's direction.");
  table->Field("max_samples", &fit.max_samples, AtLeast(1),
               "Most random samples for the parameters of one group.");
  table->Field("max_mads", &max_mads, GreaterThan(0),
               "Farthest from its group that a member may be, in median absolute distances.");
  table->Field("keep_px", &keep_px, AtLeast(0),
               "Members nearer than this stay, in pixels at their depth.");
  table->Field("keep_deg", &keep_deg, AtLeast(0),
               "Lines nearer than this to the direction of their vanishing point stay.");
  table->Field("min_inliers", &min_inliers, AtLeast(1), "Fewest members of a group.");
  table->Field("min_inlier_ratio", &min_inlier_ratio, Between(0, 1),
               "Least share of its members that a group keeps, or it is removed.");
}

}  // namespace holba
