// SPDX-License-Identifier: BSD-3-Clause
#include "apps/extract/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "holba/base/memory.h"

namespace holba {
namespace {

using nlohmann::json;

struct Sums {
  size_t used = 0, left_out = 0, points_kept = 0, structure_kept = 0, cut_off = 0, priors = 0;
  size_t keypoints = 0, segments = 0, corners = 0, vanishing_points = 0;
  std::vector<size_t> keypoints_of_image;
};

Sums Sum(const ExtractReport& report) {
  Sums sums;
  for (const ExtractReport::OfImage& image : report.images) {
    if (image.fault) {
      ++sums.left_out;
      continue;
    }
    ++sums.used;
    sums.points_kept += image.points_kept;
    sums.structure_kept += image.structure_kept;
    sums.cut_off += image.is_cut_off;
    sums.priors += image.has_pose_prior;
    sums.keypoints += image.num_keypoints;
    sums.segments += image.num_segments;
    sums.corners += image.num_corners;
    sums.vanishing_points += image.num_vanishing_points;
    sums.keypoints_of_image.push_back(image.num_keypoints);
  }
  std::sort(sums.keypoints_of_image.begin(), sums.keypoints_of_image.end());
  return sums;
}

std::string StatusOf(const ExtractReport::OfImage& image) {
  return image.fault ? "left out" : image.points_kept ? "kept" : "extracted";
}

}  // namespace

std::string ExtractToText(const ExtractReport& report) {
  const Sums sums = Sum(report);
  size_t width = 5;
  for (const ExtractReport::OfImage& image : report.images)
    width = std::max(width, std::min<size_t>(image.name.size(), 60));
  std::string text = fmt::format("{:<{}} {:>7} {:>7} {:>9} {:>8} {:>4}  {}\n", "image", width,
                                 "camera", "points", "segments", "corners", "VPs", "");
  for (const ExtractReport::OfImage& image : report.images) {
    if (image.fault) {
      text += fmt::format("{:<{}} left out: {}\n", image.name, width, *image.fault);
      continue;
    }
    text += fmt::format("{:<{}} {:>7} {:>7} {:>9} {:>8} {:>4}  {}\n", image.name, width,
                        image.camera_id, image.num_keypoints, image.num_segments, image.num_corners,
                        image.num_vanishing_points,
                        image.points_kept  ? "kept"
                        : image.is_cut_off ? "ends early"
                                           : "");
  }
  // No blanks at ends of lines.
  for (size_t at; (at = text.find(" \n")) != std::string::npos;) text.erase(at, 1);
  text += fmt::format(
      "\n{} images of {} cameras ({} with a known focal length), {} with a pose "
      "prior, {} left out\n",
      sums.used, report.num_cameras, report.num_cameras_with_prior_focal_length, sums.priors,
      sums.left_out);
  text += fmt::format("{} points, {} segments, {} corners, {} vanishing points", sums.keypoints,
                      sums.segments, sums.corners, sums.vanishing_points);
  if (report.num_labelled_regions > 0)
    text += fmt::format(", {} labelled regions", report.num_labelled_regions);
  if (!sums.keypoints_of_image.empty()) {
    const std::vector<size_t>& sorted = sums.keypoints_of_image;
    text += fmt::format("\npoints of an image: {} to {}, half have {} or more", sorted.front(),
                        sorted.back(), sorted[sorted.size() / 2]);
  }
  for (const auto& [reason, count] : report.dropped)
    text += fmt::format("\nnot imported: {} {}", count, reason);
  text += fmt::format("\n{:.1f} s, {:.2f} images/s, {:.0f} MB at most\n", report.seconds,
                      static_cast<double>(report.images.size()) / std::max(report.seconds, 1e-6),
                      PeakMemoryMb());
  return text;
}

json ExtractToJson(const ExtractReport& report) {
  const Sums sums = Sum(report);
  json images = json::array();
  for (const ExtractReport::OfImage& image : report.images) {
    json entry = {{"name", image.name}, {"status", StatusOf(image)}};
    if (image.fault) {
      entry["reason"] = *image.fault;
    } else {
      entry.update({{"camera_id", image.camera_id},
                    {"points", image.num_keypoints},
                    {"segments", image.num_segments},
                    {"corners", image.num_corners},
                    {"vanishing_points", image.num_vanishing_points},
                    {"structure_kept", image.structure_kept},
                    {"ends_early", image.is_cut_off},
                    {"pose_prior", image.has_pose_prior}});
    }
    images.push_back(std::move(entry));
  }
  return {{"images", std::move(images)},
          {"cameras", report.num_cameras},
          {"cameras_with_prior_focal_length", report.num_cameras_with_prior_focal_length},
          {"left_out", sums.left_out},
          {"kept", sums.points_kept},
          {"points", sums.keypoints},
          {"segments", sums.segments},
          {"corners", sums.corners},
          {"vanishing_points", sums.vanishing_points},
          {"labelled_regions", report.num_labelled_regions},
          {"dropped", report.dropped},
          {"seconds", report.seconds},
          {"peak_memory_mb", PeakMemoryMb()}};
}

}  // namespace holba
