// SPDX-License-Identifier: BSD-3-Clause
// holba inspect: what a database holds, in numbers and as a picture.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/command.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/words.h"
#include "holba/io/database.h"
#if defined(HOLBA_WITH_FRONTEND)
#include "holba/pipeline/database_pictures.h"
#endif

namespace holba {
namespace {

using nlohmann::json;

std::string Count(const std::optional<size_t>& count) {
  return count ? std::to_string(*count) : "-";
}

std::string ToText(const DatabaseSummary& summary) {
  std::string text;
  for (const auto& [camera_id, entry] : summary.cameras) {
    const Camera& camera = entry.camera;
    text += fmt::format("camera {}: {} {} x {}, {:.8g}{}\n", camera_id, camera.model->name,
                        camera.width, camera.height, fmt::join(camera.params, ", "),
                        entry.has_prior_focal_length ? " (focal length known)" : "");
  }
  size_t width = 5;
  for (const auto& image : summary.images)
    width = std::max(width, std::min<size_t>(image.name.size(), 60));
  if (!summary.images.empty()) {
    text += fmt::format("\n{:>7} {:<{}} {:>7} {:>7} {:>11} {:>9} {:>8} {:>4} {:>7} {:>6}\n", "id",
                        "image", width, "camera", "points", "descriptors", "segments", "corners",
                        "VPs", "regions", "prior");
  }
  size_t num_points = 0;
  for (const auto& image : summary.images) {
    num_points += image.num_keypoints.value_or(0);
    text +=
        fmt::format("{:>7} {:<{}} {:>7} {:>7} {:>11} {:>9} {:>8} {:>4} {:>7} {:>6}\n",
                    image.image_id, image.name, width, image.camera_id, Count(image.num_keypoints),
                    Count(image.num_descriptors), Count(image.num_segments),
                    Count(image.num_corners), Count(image.num_vanishing_points),
                    image.has_label_map ? "yes" : "-", image.has_pose_prior ? "yes" : "-");
  }
  text += fmt::format(
      "\n{}, {}, {}, {}, {}, {}\n"
      "{} tried, {} with matches ({})\n"
      "{} ({})",
      Counted(summary.images.size(), "image"), Counted(summary.cameras.size(), "camera"),
      Counted(summary.num_rigs, "rig"), Counted(summary.num_frames, "frame"),
      Counted(summary.num_pose_priors, "pose prior"), Counted(num_points, "point"),
      Counted(summary.num_pairs_tried, "pair"), summary.num_matched_pairs,
      Counted(summary.num_matches, "match"), Counted(summary.num_verified_pairs, "verified pair"),
      Counted(summary.num_inliers, "inlier"));
  for (const auto& [config, count] : summary.num_of_config)
    text += fmt::format(", {} {}", count, NameOf(config));
  text +=
      fmt::format("\n{} with line matches ({})\n", Counted(summary.num_line_matched_pairs, "pair"),
                  Counted(summary.num_line_matches, "match"));
  return text;
}

json ToJson(const DatabaseSummary& summary) {
  const auto number = [](const std::optional<size_t>& count) {
    return count ? json(*count) : json(nullptr);
  };
  json cameras = json::array(), images = json::array(), configs = json::object();
  for (const auto& [camera_id, entry] : summary.cameras) {
    cameras.push_back({{"camera_id", camera_id},
                       {"model", entry.camera.model->name},
                       {"width", entry.camera.width},
                       {"height", entry.camera.height},
                       {"params", entry.camera.params},
                       {"has_prior_focal_length", entry.has_prior_focal_length}});
  }
  for (const auto& image : summary.images) {
    images.push_back({{"image_id", image.image_id},
                      {"name", image.name},
                      {"camera_id", image.camera_id},
                      {"points", number(image.num_keypoints)},
                      {"descriptors", number(image.num_descriptors)},
                      {"segments", number(image.num_segments)},
                      {"corners", number(image.num_corners)},
                      {"vanishing_points", number(image.num_vanishing_points)},
                      {"label_map", image.has_label_map},
                      {"pose_prior", image.has_pose_prior}});
  }
  for (const auto& [config, count] : summary.num_of_config) configs[NameOf(config)] = count;
  return {{"cameras", cameras},
          {"images", images},
          {"rigs", summary.num_rigs},
          {"frames", summary.num_frames},
          {"pose_priors", summary.num_pose_priors},
          {"pairs_tried", summary.num_pairs_tried},
          {"matched_pairs", summary.num_matched_pairs},
          {"matches", summary.num_matches},
          {"verified_pairs", summary.num_verified_pairs},
          {"inliers", summary.num_inliers},
          {"configurations", configs},
          {"line_matched_pairs", summary.num_line_matched_pairs},
          {"line_matches", summary.num_line_matches}};
}

class InspectJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("database_path", &database_path_, "COLMAP database.").Required();
#if defined(HOLBA_WITH_FRONTEND)
    table->Field("image_names", &image_names_,
                 "One image, or two with a comma between them, that a picture is made of.");
    table->Field("picture_path", &picture_path_,
                 "Picture (png, jpg) of what the images hold and, of two, their matches.");
    table->Field("image_path", &image_path_,
                 "Folder of the photographs; empty: the picture is drawn on white.");
    table->Field("picture_size", &picture_size_, Between(100, 10000),
                 "Longer side in pixels of each image in the picture.");
#endif
  }

  void ProbeOutputs(const Invocation&) const override {
#if defined(HOLBA_WITH_FRONTEND)
    if (image_names_.empty() != picture_path_.empty()) {
      throw InputError(
          "a picture needs both --image_names and --picture_path; give both or neither");
    }
    if (!picture_path_.empty()) ProbePicture(picture_path_);
#endif
    ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    // A Database would make one.
    if (!std::filesystem::exists(database_path_)) throw NoSuchFile(database_path_);
    if (!std::filesystem::is_regular_file(database_path_)) throw FileIsWanted(database_path_);
    const Database database(database_path_);
#if defined(HOLBA_WITH_FRONTEND)
    if (!picture_path_.empty()) {
      std::optional<std::filesystem::path> folder;
      if (!image_path_.empty()) folder = image_path_;
      if (folder && !std::filesystem::is_directory(*folder))
        throw NoSuchFolder(*folder, "--image_path");
      WritePicture(
          DrawDatabaseImages(database, NamedImages(database, image_names_), folder, picture_size_),
          picture_path_);
    }
#endif
    const DatabaseSummary summary = database.Summarise();
    PrintResult(invocation.json ? ToJson(summary).dump(2) + "\n" : ToText(summary));
  }

 private:
  std::string database_path_;
#if defined(HOLBA_WITH_FRONTEND)
  std::string image_names_, picture_path_, image_path_;
  int picture_size_ = 1000;
#endif
};

}  // namespace

Command InspectCommand() {
  return {.name = "inspect",
          .summary = "What a database holds: cameras, images, features, pairs; as a picture, too",
          .details =
              "Prints what any COLMAP database holds. With --image_names a.jpg,b.jpg and "
              "--picture_path it also draws these\n"
              "images side by side: points, segments and corners, inliers, rejected "
              "matches, matched segments.",
          .supports_json = true,
          .make_job = [] { return std::make_unique<InspectJob>(); }};
}

}  // namespace holba
