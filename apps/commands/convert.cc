// SPDX-License-Identifier: BSD-3-Clause
// holba convert: a model (or a BAL problem) in another format.
#include <filesystem>
#include <string>

#include "apps/command.h"
#include "apps/report.h"
#include "holba/base/log.h"
#include "holba/io/bal.h"
#include "holba/io/dxf.h"
#include "holba/io/files.h"
#include "holba/io/floor_plan.h"
#include "holba/io/glb.h"
#include "holba/io/model_io.h"
#include "holba/io/obj.h"
#include "holba/io/ply.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/selection.h"

namespace holba {
namespace {

enum class OutputType { kText, kBinary, kPly, kBal, kGlb, kObj, kDxf, kSvg };

class ConvertJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("input_path", &input_path_, "Model folder, or a BAL file.").Required();
    table->Field("output_path", &output_path_, "Model folder (txt, bin) or file (all others).")
        .Required();
    table->Choice("output_type", &output_type_,
                  {{"txt", OutputType::kText},
                   {"bin", OutputType::kBinary},
                   {"ply", OutputType::kPly},
                   {"bal", OutputType::kBal},
                   {"glb", OutputType::kGlb},
                   {"obj", OutputType::kObj},
                   {"dxf", OutputType::kDxf},
                   {"svg", OutputType::kSvg}},
                  "Format of the output; glb opens in Blender, dxf has lines in a layer for each "
                  "direction, svg is a floor plan.");
    table->Field("drop_added_points", &drop_added_points_,
                 "Leave out the points that refine made of structure (junctions, corners) with "
                 "their 2D points, so that images have the keypoints of their database again: "
                 "COLMAP's mapper and triangulator refuse others.");
    read_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    if (output_type_ == OutputType::kText || output_type_ == OutputType::kBinary) {
      ProbeModelFolder(output_path_);
    } else {
      ProbeFile(output_path_);
    }
  }

  void Run(const Invocation&) override {
    Reconstruction model = std::filesystem::is_regular_file(input_path_)
                               ? ReadBal(input_path_)
                               : ReadModel(input_path_, read_);
    if (drop_added_points_) RemovePointsOfStructure(&model);
    switch (output_type_) {
      case OutputType::kText:
        WriteModel(model, output_path_, ModelFormat::kText);
        break;
      case OutputType::kBinary:
        WriteModel(model, output_path_, ModelFormat::kBinary);
        break;
      case OutputType::kPly:
        WritePly(model, output_path_);
        break;
      case OutputType::kBal:
        WriteBal(model, output_path_);
        break;
      case OutputType::kGlb:
        WriteGlb(model, output_path_);
        break;
      case OutputType::kObj:
        WriteObj(model, output_path_);
        break;
      case OutputType::kDxf:
        WriteDxf(model, output_path_);
        break;
      case OutputType::kSvg:
        WriteFloorPlan(model, output_path_);
        break;
    }
    LogInfo("Wrote {} to {}", ContentsText(model), output_path_);
  }

 private:
  std::string input_path_;
  std::string output_path_;
  ReadModelOptions read_;
  OutputType output_type_ = OutputType::kBinary;
  bool drop_added_points_ = false;
};

}  // namespace

Command ConvertCommand() {
  return {.name = "convert",
          .summary = "Write a model as text, binary, PLY, BAL, glTF, OBJ, DXF or a floor plan",
          .details = "",
          .make_job = [] { return std::make_unique<ConvertJob>(); }};
}

}  // namespace holba
