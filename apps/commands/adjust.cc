// SPDX-License-Identifier: BSD-3-Clause
// holba adjust: holistic bundle adjustment of a model, or of a BAL problem.
#include <optional>
#include <string>

#include "apps/adjust/checkpoint.h"
#include "apps/command.h"
#include "apps/report.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/plausibility.h"
#include "holba/io/bal.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/solver/ranks.h"

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
    table
        ->Field("checkpoint_path", &checkpoint_path_,
                "Folder that keeps the state of the adjustment while it runs, for --resume.")
        .Advanced();
    table
        ->Field("checkpoint_iterations", &checkpoint_iterations_, AtLeast(1),
                "Iterations from one state that is kept to the next.")
        .Advanced();
    table
        ->Field("resume", &resume_,
                "Whether to go on from what --checkpoint_path holds; the result is that of an "
                "adjustment that was never stopped.")
        .Advanced();
    table
        ->Field("petsc", &solver_.petsc_options,
                "Options of PETSc's solvers, as on its command line, for the backend petsc (where "
                "this build has it): --petsc=\"-pc_type asm\".")
        .Advanced();
    read_.Describe(table);
    bundle_.Describe(table);
    solver_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    BeginRanks();
    ranks::OnFirst([&] {
      if (IsBal()) {
        ProbeFile(output_path_);
      } else {
        ProbeModelFolder(output_path_);
      }
      if (!checkpoint_path_.empty()) ProbeFolder(checkpoint_path_, [](auto) { return false; });
      ProbeResult();
    });
  }

  // Every rank does all of this with the same model. The first one speaks and writes.
  void Run(const Invocation& invocation) override {
    const bool is_bal = IsBal();
    Reconstruction model;
    std::vector<GroupMeasurement> measurements;
    ranks::Together([&] {
      model = is_bal ? ReadBal(input_path_) : ReadModel(input_path_, read_);
      if (!measurements_path_.empty())
        measurements = ReadGroupMeasurements(measurements_path_, model);
      RefuseWithoutResiduals(input_path_, model);
    });
    WarnOfDoubts("Before the adjustment", model);
    bundle_.SetDefaultLosses(is_bal);
    std::optional<SolveJournal> journal;
    if (!checkpoint_path_.empty()) {
      if (!resume_) RemoveCheckpoint(checkpoint_path_);
      journal.emplace(CheckpointStore(checkpoint_path_), checkpoint_iterations_, resume_);
      solver_.journal = &*journal;
    }
    solver_.analyse_reduced_system = true;
    solver_.on_iteration = [](const IterationRecord& record) {
      if (record.iteration == 0) LogInfo("{}", IterationHeader(record));
      LogInfo("{}", IterationLine(record));
      return true;
    };
    const BundleSummary summary =
        AdjustBundle(bundle_, solver_, &model, measurements,
                     [](const std::string& text) { LogInfo("{}", text); });
    ranks::Together([&] {
      if (NothingWasAdjusted(summary)) throw InputError(input_path_, WhyNothingIsLeft(model));
    });
    WarnOfWhatWasHeld(summary);
    WarnOfDoubts("After the adjustment", model);
    WarnOfUnusedPetscOptions();

    ranks::OnFirst([&] {
      if (is_bal) {
        WriteBal(model, output_path_);
      } else {
        WriteModel(model, output_path_, format_);
      }
      PrintResult(invocation.json ? JsonText(SummaryToJson(summary)) : SummaryToText(summary));
    });
    if (journal) RemoveCheckpoint(checkpoint_path_);
  }

 private:
  void BeginRanks() const {
    if (resume_ && checkpoint_path_.empty())
      throw InputError(
          "--resume goes on from a checkpoint; give its folder with --checkpoint_path");
    if (solver_.backend == Backend::kPetsc) {
      ranks::Begin(solver_.petsc_options);
    } else if (ranks::LaunchedSize() > 1) {
      ranks::StopAllButFirst();
      throw InputError(
          fmt::format("a launcher has started {} processes, and this solver runs in one; expected "
                      "--Solver.backend petsc",
                      ranks::LaunchedSize()));
    } else if (!solver_.petsc_options.empty()) {
      throw InputError("--petsc is for PETSc's solvers; give --Solver.backend petsc with it");
    }
    if (ranks::Rank() > 0) SetLogLevel(LogLevel::kError);
  }

  static void WarnOfUnusedPetscOptions() {
    const std::string unused = ranks::UnusedPetscOptions();
    if (!unused.empty()) LogWarning("PETSc has used no option of the name {}", unused);
  }

  bool IsBal() const { return IsReadAsBal(input_path_); }

  std::string input_path_;
  std::string output_path_;
  std::string measurements_path_;
  std::string checkpoint_path_;
  int checkpoint_iterations_ = 10;
  bool resume_ = false;
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
