// SPDX-License-Identifier: BSD-3-Clause
// holba evaluate: the cost of a model by kind of term, and its errors against a true model.
#include <fmt/format.h>

#include <cmath>
#include <string>

#include "apps/command.h"
#include "apps/report.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/evaluation/ground_truth.h"
#include "holba/io/bal.h"
#include "holba/io/model_io.h"

namespace holba {
namespace {

nlohmann::json TruthErrorsToJson(const Reconstruction& model, const Reconstruction& truth,
                                 const std::string& truth_path, AlignmentBasis basis) {
  const ImagePairing pairing = PairImages(model, truth);
  ReportPairing(pairing, truth_path);
  if (!pairing.features_have_same_ids && !model.points3D.empty() && !truth.points3D.empty()) {
    LogWarning(
        "{}: points of one id are not the same in the model and in the truth, so that only poses "
        "are compared",
        truth_path);
  }
  const std::optional<GroundTruthErrors> errors = CompareToTruth(model, truth, pairing, basis);
  if (!errors)
    throw InputError(
        truth_path,
        "has no image in common with the model; give the true poses of the same images");
  const Alignment& alignment = errors->alignment;
  if (alignment.num_left_out > 0) {
    LogInfo("Aligned by {} of camera centres and points; {} {} far off and left out",
            Counted(alignment.num_positions - alignment.num_left_out, "position"),
            Counted(alignment.num_left_out, "other"), Agree(alignment.num_left_out, "is", "are"));
  }
  nlohmann::json object = nlohmann::json::object();
  for (const auto& [name, value] : errors->Named()) object[name] = value;
  return object;
}

class EvaluateJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table
        ->Field("input_path", &input_path_,
                "Model: a folder, a file of another program, or a BAL file (.bz2, too).")
        .Required();
    table->Field(
        "ground_truth_path", &ground_truth_path_,
        "True model, or its poses only, with like image names: adds errors after a similarity (of "
        "points, lines and groups, too, where ids are the same).");
    table->Choice("alignment", &alignment_,
                  {{"auto", AlignmentBasis::kAuto},
                   {"centres", AlignmentBasis::kCentres},
                   {"centres_and_points", AlignmentBasis::kCentresAndPoints}},
                  "What the similarity is found by (auto: centres of cameras and points, if both "
                  "models have 3 points in common); what is far off is left out.");
    table->Field("group_measurements_path", &measurements_path_,
                 "Text file of directions of groups measured in images, as for adjust.");
    read_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override { ProbeResult(); }

  void Run(const Invocation& invocation) override {
    const bool is_bal = IsReadAsBal(input_path_);
    const Reconstruction model = is_bal ? ReadBal(input_path_) : ReadModel(input_path_, read_);
    std::vector<GroupMeasurement> measurements;
    if (!measurements_path_.empty())
      measurements = ReadGroupMeasurements(measurements_path_, model);
    WarnOfDoubts(input_path_, model);
    const std::vector<TermCost> terms = EvaluateModel(model, measurements);
    nlohmann::json result = {{"terms", TermsToJson(terms)}};
    if (!ground_truth_path_.empty()) {
      result["ground_truth"] =
          TruthErrorsToJson(model, ReadPoses(ground_truth_path_), ground_truth_path_, alignment_);
    }
    if (invocation.json) {
      PrintResult(JsonText(result));
      return;
    }
    std::string text = fmt::format("{:<18} {:>10} {:>8} {:>16} {:>12}\n", "term", "residuals",
                                   "absent", "sum of squares", "rms");
    for (const TermCost& term : terms) {
      const size_t present = term.residuals - term.absent;
      text +=
          fmt::format("{:<18} {:>10} {:>8} {:>16.8g} {:>12.5g}\n", term.term, present, term.absent,
                      term.sum_squares,
                      present ? std::sqrt(term.sum_squares / static_cast<double>(present)) : 0.0);
    }
    if (result.contains("ground_truth")) {
      for (const auto& [name, value] : result["ground_truth"].items()) {
        text += fmt::format("{:<36} {:>12.6g}\n", name, value.get<double>());
      }
    }
    PrintResult(text);
  }

 private:
  std::string input_path_;
  std::string ground_truth_path_;
  AlignmentBasis alignment_ = AlignmentBasis::kAuto;
  std::string measurements_path_;
  ReadModelOptions read_;
};

}  // namespace

Command EvaluateCommand() {
  return {.name = "evaluate",
          .summary = "Cost of a model by kind of term, and its errors against a true model",
          .details =
              "The sums of squares are of the residuals as they are, before weights and robust "
              "losses; a residual\n"
              "that is undefined at the model (behind the camera) is counted as absent.",
          .supports_json = true,
          .make_job = [] { return std::make_unique<EvaluateJob>(); }};
}

}  // namespace holba
