// SPDX-License-Identifier: BSD-3-Clause
// holba synthesize: a synthetic adjustment problem, as a true and a perturbed model.
#include <filesystem>
#include <string>
#include <string_view>

#include "apps/command.h"
#include "apps/report.h"
#include "holba/base/log.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

class SynthesizeJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("output_path", &output_path_,
                 "Folder to write the models `truth` and `perturbed` to.").Required();
    table->Choice("output_type", &output_type_,
                  {{"txt", ModelFormat::kText}, {"bin", ModelFormat::kBinary}},
                  "Format of the output.");
    options_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    const std::filesystem::path folder = output_path_;
    ProbeFolder(folder, [](std::string_view) { return false; });
    ProbeModelFolder(folder / kTruth);
    ProbeModelFolder(folder / kPerturbed);
  }

  void Run(const Invocation&) override {
    const SyntheticProblem problem = MakeBundleProblem(options_);
    // Both at once: a truth beside the start of another scene would be taken for its own.
    StagedFolder stage(output_path_);
    StageModel(problem.truth, output_type_, std::string(kTruth) + '/', &stage);
    StageModel(problem.perturbed, output_type_, std::string(kPerturbed) + '/', &stage);
    stage.Commit([](std::string_view name) {
      const size_t slash = name.find('/');
      if (slash == std::string_view::npos) return false;
      const std::string_view folder = name.substr(0, slash);
      return (folder == kTruth || folder == kPerturbed) && IsModelFile(name.substr(slash + 1));
    });
    const Reconstruction& model = problem.truth;
    LogInfo("Wrote the models truth and perturbed, each of {}, to {}", ContentsText(model),
            output_path_);
  }

 private:
  static constexpr std::string_view kTruth = "truth", kPerturbed = "perturbed";

  std::string output_path_;
  ModelFormat output_type_ = ModelFormat::kBinary;
  BundleProblemOptions options_;
};

}  // namespace

Command SynthesizeCommand() {
  return {.name = "synthesize",
          .summary = "Make a synthetic adjustment problem with ground truth",
          .details =
              "Writes two models with the same ids and the same noisy observations: "
              "OUTPUT_PATH/truth with the true poses and structure, and OUTPUT_PATH/perturbed, the "
              "start of an adjustment. The scene is the paper's synthetic benchmark: cameras on a "
              "sphere around a cube with axis-aligned planes, points and lines; f 700 px, "
              "1000 x 1000 px images; each feature seen by 4 to 8 of them.",
          .supports_json = false,
          .make_job = [] { return std::make_unique<SynthesizeJob>(); }};
}

}  // namespace holba
