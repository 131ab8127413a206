// SPDX-License-Identifier: BSD-3-Clause
#include "apps/localize/report.h"

#include <fmt/format.h>

#include <algorithm>

#include "holba/base/words.h"

namespace holba {
namespace {

using nlohmann::json;

json OfKinds(const ForEachKind<size_t>& counts) {
  return {{"points", counts.points}, {"lines", counts.lines}, {"directions", counts.directions}};
}

std::string OutOf(size_t inliers, size_t matches) {
  return matches == 0 ? "-" : fmt::format("{}/{}", inliers, matches);
}

}  // namespace

std::string LocalizeToText(const LocalizeReport& report) {
  size_t width = 5;
  for (const LocalizedImage& image : report.images)
    width = std::max(width, std::min<size_t>(image.name.size(), 60));
  std::string text = fmt::format("{:<{}} {:>11} {:>9} {:>7} {:>9} {:>9} {:>9}\n", "image", width,
                                 "points", "lines", "VPs", "focal px", "+- deg", "+- centre");
  for (const LocalizedImage& image : report.images) {
    if (!image.pose) {
      text += fmt::format("{:<{}} not localised: {}\n", image.name, width, image.failure);
      continue;
    }
    const AbsolutePose& pose = *image.pose;
    const auto focal_idxs = image.camera.model->focal_idxs;
    text += fmt::format(
        "{:<{}} {:>11} {:>9} {:>7} {:>9} {:>9.4f} {:>9.4g}\n", image.name, width,
        OutOf(pose.num_inliers.points, image.num_matches.points),
        OutOf(pose.num_inliers.lines, image.num_matches.lines),
        OutOf(pose.num_inliers.directions, image.num_matches.directions),
        focal_idxs.empty() ? "-" : fmt::format("{:.1f}", image.camera.params[focal_idxs[0]]),
        image.RotationSigmaDeg(), image.CentreSigma());
  }
  text += fmt::format("{} of {} localised; features {:.1f} s, matches {:.1f} s, poses {:.2f} s\n",
                      report.num_localized, Counted(report.images.size(), "image"),
                      report.extract_seconds, report.match_seconds, report.pose_seconds);
  return text;
}

json LocalizeToJson(const LocalizeReport& report) {
  json images = json::array();
  for (const LocalizedImage& image : report.images) {
    json entry = {{"name", image.name},
                  {"localized", image.pose.has_value()},
                  {"neighbours", image.num_neighbours},
                  {"matches", OfKinds(image.num_matches)}};
    if (!image.pose) {
      entry["reason"] = image.failure;
      images.push_back(std::move(entry));
      continue;
    }
    const AbsolutePose& pose = *image.pose;
    const Eigen::Quaterniond& q = pose.cam_from_world.rotation;
    const Eigen::Vector3d& t = pose.cam_from_world.translation;
    const Eigen::Vector3d c = pose.cam_from_world.OriginInA();
    json covariance = json::array();
    for (int row = 0; row < 6; ++row) {
      json values = json::array();
      for (int col = 0; col < 6; ++col) values.push_back(pose.covariance(row, col));
      covariance.push_back(std::move(values));
    }
    entry.update(
        {{"image_id", *image.image_id},
         {"cam_from_world",
          {{"qvec_wxyz", {q.w(), q.x(), q.y(), q.z()}}, {"tvec", {t.x(), t.y(), t.z()}}}},
         {"centre", {c.x(), c.y(), c.z()}},
         {"covariance", std::move(covariance)},
         {"rotation_sigma_deg", image.RotationSigmaDeg()},
         {"centre_sigma", image.CentreSigma()},
         {"inliers", OfKinds(pose.num_inliers)},
         {"noise_px", {{"points", pose.noise_sigma.points}, {"lines", pose.noise_sigma.lines}}},
         {"noise_rad", {{"directions", pose.noise_sigma.directions}}},
         {"focal_was_known", image.focal_was_known},
         {"camera",
          {{"model", image.camera.model->name},
           {"width", image.camera.width},
           {"height", image.camera.height},
           {"params", image.camera.params}}},
         {"trials", pose.num_trials}});
    images.push_back(std::move(entry));
  }
  return {{"images", std::move(images)},
          {"localized", report.num_localized},
          {"seconds",
           {{"extract", report.extract_seconds},
            {"match", report.match_seconds},
            {"pose", report.pose_seconds}}}};
}

}  // namespace holba
