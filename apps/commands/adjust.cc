// SPDX-License-Identifier: BSD-3-Clause
// holba adjust: holistic bundle adjustment of a model, or of a BAL problem.
#include <string>

#include "apps/command.h"
#include "apps/report.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/plausibility.h"
#include "holba/io/bal.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"

namespace holba {
namespace {

class AdjustJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table
        ->Field("input_path", &input_path_,
                "Model: a folder, a file of another program, or a BAL file (.bz2 is read, too).")
        .Required();
    table->Field("output_path", &output_path_, "Model folder; for a BAL file, a BAL file.")
        .Required();
    table->Choice("output_type", &format_,
                  {{"txt", ModelFormat::kText}, {"bin", ModelFormat::kBinary}},
                  "Format of the model folder.");
    table->Field("group_measurements_path", &measurements_path_,
                 "Text file of directions of groups measured in images, lines of IMAGE_ID "
                 "GROUP3D_ID DX DY DZ SIGMA_DEG "
                 "(camera frame).");
    read_.Describe(table);
    bundle_.Describe(table);
    solver_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    if (IsBal()) {
      ProbeFile(output_path_);
    } else {
      ProbeModelFolder(output_path_);
    }
    ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    const bool is_bal = IsBal();
    Reconstruction model = is_bal ? ReadBal(input_path_) : ReadModel(input_path_, read_);
    std::vector<GroupMeasurement> measurements;
    if (!measurements_path_.empty())
      measurements = ReadGroupMeasurements(measurements_path_, model);

    RefuseWithoutResiduals(input_path_, model);
    WarnOfDoubts("Before the adjustment", model);
    bundle_.SetDefaultLosses(is_bal);
    solver_.analyse_reduced_system = true;
    solver_.on_iteration = [](const IterationRecord& record) {
      if (record.iteration == 0) LogInfo("{}", IterationHeader(record));
      LogInfo("{}", IterationLine(record));
      return true;
    };
    const BundleSummary summary =
        AdjustBundle(bundle_, solver_, &model, measurements,
                     [](const std::string& text) { LogInfo("{}", text); });
    if (NothingWasAdjusted(summary)) throw InputError(input_path_, WhyNothingIsLeft(model));
    WarnOfWhatWasHeld(summary);
    WarnOfDoubts("After the adjustment", model);

    if (is_bal) {
      WriteBal(model, output_path_);
    } else {
      WriteModel(model, output_path_, format_);
    }
    PrintResult(invocation.json ? JsonText(SummaryToJson(summary)) : SummaryToText(summary));
  }

 private:
  bool IsBal() const { return IsReadAsBal(input_path_); }

  std::string input_path_;
  std::string output_path_;
  std::string measurements_path_;
  ModelFormat format_ = ModelFormat::kBinary;
  ReadModelOptions read_;
  BundleOptions bundle_;
  SolverOptions solver_;
};

}  // namespace

Command AdjustCommand() {
  return {.name = "adjust",
          .summary = "Adjust cameras, points, lines, groups and wireframe of a model together",
          .details =
              "Prints a line per iteration on stderr (cost by kind of term, step, damping, time) "
              "and a summary on\n"
              "stdout; --json gives the summary as one object.",
          .supports_json = true,
          .make_job = [] { return std::make_unique<AdjustJob>(); }};
}

}  // namespace holba
