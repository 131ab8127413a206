// SPDX-License-Identifier: BSD-3-Clause
// holba convert: a model of any program in another format, and features between databases.
#include <filesystem>
#include <string>

#include "apps/command.h"
#include "apps/report.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/io/bal.h"
#include "holba/io/database.h"
#include "holba/io/dxf.h"
#include "holba/io/files.h"
#include "holba/io/floor_plan.h"
#include "holba/io/foreign/limap.h"
#include "holba/io/foreign/limap_database.h"
#include "holba/io/foreign/nerfstudio.h"
#include "holba/io/glb.h"
#include "holba/io/model_io.h"
#include "holba/io/obj.h"
#include "holba/io/ply.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/selection.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

enum class OutputType {
  kText,
  kBinary,
  kLimap,
  kNerfstudio,
  kPly,
  kBal,
  kGlb,
  kObj,
  kDxf,
  kSvg,
  kDatabase
};

class ConvertJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table
        ->Field("input_path", &input_path_,
                "Model: a folder, or a file of another program (docs/files.md); or a database.")
        .Required();
    table
        ->Field("output_path", &output_path_,
                "Folder (txt, bin, limap, nerfstudio) or file (all others).")
        .Required();
    table->Choice("output_type", &output_type_,
                  {{"txt", OutputType::kText},
                   {"bin", OutputType::kBinary},
                   {"limap", OutputType::kLimap},
                   {"nerfstudio", OutputType::kNerfstudio},
                   {"ply", OutputType::kPly},
                   {"bal", OutputType::kBal},
                   {"glb", OutputType::kGlb},
                   {"obj", OutputType::kObj},
                   {"dxf", OutputType::kDxf},
                   {"svg", OutputType::kSvg},
                   {"database", OutputType::kDatabase}},
                  "Format of the output: glb opens in Blender, dxf has lines in a layer for each "
                  "direction, svg is a floor plan; of a COLMAP database limap writes LIMAP's "
                  "database with its segments, vanishing points and matches of segments, and "
                  "database adds those of LIMAP's database to COLMAP's.");
    table->Field("drop_added_points", &drop_added_points_,
                 "Leave out the points that refine made of structure (junctions, corners) with "
                 "their 2D points, so that images have the keypoints of their database again: "
                 "COLMAP's mapper and triangulator refuse others.");
    read_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    switch (output_type_) {
      case OutputType::kText:
      case OutputType::kBinary:
        return ProbeModelFolder(output_path_);
      case OutputType::kLimap:
        return IsColmapDatabase() ? ProbeFile(output_path_) : ProbeLimap(output_path_);
      case OutputType::kNerfstudio:
        return ProbeNerfstudio(output_path_);
      case OutputType::kPly:
      case OutputType::kBal:
      case OutputType::kGlb:
      case OutputType::kObj:
      case OutputType::kDxf:
      case OutputType::kSvg:
        return ProbeFile(output_path_);
      case OutputType::kDatabase:
        return ProbeExistingDatabase(output_path_);
    }
  }

  void Run(const Invocation&) override {
    if (output_type_ == OutputType::kDatabase) return AddToColmapDatabase();
    if (IsColmapDatabase()) return WriteDatabaseOfLimap();
    const bool is_bal = IsReadAsBal(input_path_);
    Reconstruction model = is_bal ? ReadBal(input_path_) : ReadModel(input_path_, read_);
    if (drop_added_points_) RemovePointsOfStructure(&model);
    Write(model);
    LogInfo("Wrote {} to {}", ContentsText(model), output_path_);
  }

 private:
  bool IsColmapDatabase() const {
    return IsSqliteFile(input_path_) && !IsLimapDatabase(input_path_);
  }

  void Write(const Reconstruction& model) const {
    switch (output_type_) {
      case OutputType::kText:
        return WriteModel(model, output_path_, ModelFormat::kText);
      case OutputType::kBinary:
        return WriteModel(model, output_path_, ModelFormat::kBinary);
      case OutputType::kLimap:
        return WriteLimap(model, output_path_);
      case OutputType::kNerfstudio:
        return WriteNerfstudio(model, output_path_);
      case OutputType::kPly:
        return WritePly(model, output_path_);
      case OutputType::kBal:
        return WriteBal(model, output_path_);
      case OutputType::kGlb:
        return WriteGlb(model, output_path_);
      case OutputType::kObj:
        return WriteObj(model, output_path_);
      case OutputType::kDxf:
        return WriteDxf(model, output_path_);
      case OutputType::kSvg:
        return WriteFloorPlan(model, output_path_);
      case OutputType::kDatabase:
        return;
    }
  }

  void AddToColmapDatabase() const {
    if (!IsLimapDatabase(input_path_)) {
      throw InputError(input_path_,
                       "--output_type database takes LIMAP's database only; give another output "
                       "type for a model");
    }
    const LimapDatabase limap = ReadLimapDatabase(input_path_);
    Database database(output_path_);
    const size_t num_images = AddToDatabase(limap, input_path_, &database);
    LogInfo("Added the segments, vanishing points and matches of {} to {}",
            Counted(num_images, "image"), output_path_);
  }

  void WriteDatabaseOfLimap() const {
    if (output_type_ != OutputType::kLimap) {
      throw InputError(input_path_,
                       "a database holds no model; give --output_type limap for LIMAP's database "
                       "of its features, or the folder of a model");
    }
    const Database database(input_path_);
    WriteLimapDatabase(LimapDatabaseOf(database), output_path_);
    LogInfo("Wrote the segments, vanishing points and matches to {}", output_path_);
  }

  std::string input_path_;
  std::string output_path_;
  ReadModelOptions read_;
  OutputType output_type_ = OutputType::kBinary;
  bool drop_added_points_ = false;
};

}  // namespace

Command ConvertCommand() {
  return {.name = "convert",
          .summary = "Write a model as COLMAP's, LIMAP's, nerfstudio's, PLY, BAL, glTF, OBJ, DXF, plan",
          .details =
              "Models of Bundler, OpenMVG, Meshroom, OpenSfM, Metashape, nerfstudio and LIMAP are "
              "recognised by what is in their files, here and wherever a model is read.",
          .make_job = [] { return std::make_unique<ConvertJob>(); }};
}

}  // namespace holba
