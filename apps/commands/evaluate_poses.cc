// SPDX-License-Identifier: BSD-3-Clause
// holba evaluate_poses: relative-pose accuracy of a model against true poses.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.h"
#include "holba/base/error.h"
#include "holba/evaluation/pose_auc.h"
#include "holba/evaluation/statistics.h"
#include "holba/io/model_io.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

// The folder itself, or its sub-folders with models (COLMAP's mapper writes 0, 1, ...).
std::vector<fs::path> FindModels(const fs::path& folder) {
  std::vector<fs::path> found;
  if (!HoldsPoses(folder) && fs::is_directory(folder)) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.is_directory() && HoldsPoses(entry.path())) found.push_back(entry.path());
    }
    std::sort(found.begin(), found.end());
  }
  if (found.empty()) found.push_back(folder);  // its reader says what is missing
  return found;
}

std::vector<double> Finite(const std::vector<double>& errors) {
  std::vector<double> finite;
  for (const double e : errors) {
    if (std::isfinite(e)) finite.push_back(e);
  }
  return finite;
}

// "1", "0.5"
std::string Shortest(double x) { return fmt::format("{:g}", x); }

class EvaluatePosesJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("input_path", &input_path_,
                 "Model folder, or a folder of models (0, 1, ...), of which the one with most "
                 "images counts.").Required();
    table
        ->Field("ground_truth_path", &ground_truth_path_,
                "Model folder with the true poses (images.txt or images.bin is enough).")
        .Required();
    table->Field("thresholds_deg", &thresholds_deg_, GreaterThan(0),
                 "Thresholds of the pose AUC in degrees.");
    table->Choice(
        "auc_convention", &convention_,
        {{"step", AucConvention::kStep}, {"trapezoid", AucConvention::kTrapezoid}},
        "How the area under the recall curve is taken (exactly, under its steps, or with the steps "
        "joined by lines as COLMAP's and hloc's benchmarks have it).");
    table->Field("min_baseline", &options_.min_baseline, AtLeast(0),
                 "Shortest true baseline, as a part of the median one, whose direction counts.");
    table->Field("fold_translation", &options_.fold_translation,
                 "Ignore the sign of translation directions.");
  }

  void ProbeOutputs(const Invocation&) const override { ProbeResult(); }

  void Run(const Invocation& invocation) override {
    if (thresholds_deg_.empty())
      throw InputError("--thresholds_deg: expected at least one threshold, found none");
    const Reconstruction truth = ReadPoses(ground_truth_path_);
    if (truth.images.size() < 2) {
      throw InputError(
          ground_truth_path_,
          "expected at least two images with poses, whose relative pose is compared, found fewer");
    }
    std::optional<PoseErrors> errors;
    for (const fs::path& path : FindModels(input_path_)) {
      PoseErrors candidate = ComparePoses(ReadPoses(path), truth, options_);
      if (!errors || candidate.registered > errors->registered) errors = std::move(candidate);
    }
    ReportPairing(errors->pairing, ground_truth_path_);
    PrintResult(invocation.json ? Json(*errors) : Table(*errors));
  }

 private:
  double AucPercent(const PoseErrors& errors, double threshold_deg) const {
    return 100.0 * PoseAuc(errors.pair_deg, threshold_deg, convention_);
  }

  std::string Json(const PoseErrors& errors) const {
    const auto summary = [](const std::vector<double>& values) -> nlohmann::ordered_json {
      const auto stats = Summarise(Finite(values));
      if (!stats) return nullptr;
      return {{"mean", stats->mean}, {"median", stats->median}, {"max", stats->max}};
    };
    nlohmann::ordered_json json;
    for (const double t : thresholds_deg_) json["auc"][Shortest(t)] = AucPercent(errors, t);
    json["registered"] = errors.registered;
    json["images"] = errors.images;
    json["pairs"] = errors.pair_deg.size();
    json["registered_pairs"] = errors.registered_pairs;
    json["rotation_deg"] = summary(errors.rotation_deg);
    json["translation_deg"] = summary(errors.translation_deg);
    return JsonText(json);
  }

  std::string Table(const PoseErrors& errors) const {
    std::string text =
        fmt::format("registered   {} of {} images, {} of {} pairs\nAUC (%)    ", errors.registered,
                    errors.images, errors.registered_pairs, errors.pair_deg.size());
    for (const double t : thresholds_deg_) {
      text += fmt::format("  @{} {:.2f}", Shortest(t), AucPercent(errors, t));
    }
    text += "\n";
    const auto add = [&](const char* name, const std::vector<double>& values) {
      if (const auto stats = Summarise(Finite(values))) {
        text += fmt::format("{:<12} mean {:.4f}  median {:.4f}  max {:.4f} deg\n", name,
                            stats->mean, stats->median, stats->max);
      }
    };
    add("rotation", errors.rotation_deg);
    add("translation", errors.translation_deg);
    return text;
  }

  std::string input_path_;
  std::string ground_truth_path_;
  std::vector<double> thresholds_deg_ = {1, 3, 5, 10};
  AucConvention convention_ = AucConvention::kStep;
  PoseErrorOptions options_;
};

}  // namespace

Command EvaluatePosesCommand() {
  return {
      .name = "evaluate_poses",
      .summary = "Compare the poses of a model with true ones (pose AUC)",
      .details =
          "Images are paired by name: whole, else by the end of the path (extensions, case, '\\' "
          "for "
          "'/' and folders before it may differ) where that is unique. Every pair "
          "of true images counts with the larger of the errors of its relative rotation and of "
          "the direction of its relative translation; the error of a pair that the model lacks "
          "is infinite. AUC@T is the area under the recall curve from 0 to T degrees divided by "
          "T, in percent. All are independent of the models' frames and scales. With --json: "
          "{\"auc\": {\"1\": ..}, \"registered\": n, \"images\": n, \"pairs\": n, "
          "\"registered_pairs\": n, \"rotation_deg\": {\"mean\", \"median\", \"max\"}, "
          "\"translation_deg\": {..}}, the angles over registered pairs.",
      .supports_json = true,
      .make_job = [] { return std::make_unique<EvaluatePosesJob>(); }};
}

}  // namespace holba
