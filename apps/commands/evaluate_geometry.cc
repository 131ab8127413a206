// SPDX-License-Identifier: BSD-3-Clause
// holba evaluate_geometry: points, lines and primitives of a model against the scene as it is.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/evaluate_geometry/geometry_report.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/evaluation/alignment.h"
#include "holba/evaluation/ground_truth.h"
#include "holba/evaluation/image_pairing.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/io/ply_reader.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

enum class FrameChoice { kSame, kAuto, kCentres, kCentresAndPoints };

// The cloud as scans, each with its points.
struct Cloud {
  std::vector<LaserScan> scans;
  bool has_scanner = false;

  std::vector<Eigen::Vector3d> InWorld() const {
    std::vector<Eigen::Vector3d> points;
    for (const LaserScan& scan : scans) {
      for (const Eigen::Vector3d& x : scan.points) points.push_back(scan.world_from_scan * x);
    }
    return points;
  }
};

Cloud ReadCloud(const fs::path& path, const std::vector<double>& scanner_position) {
  const std::string extension = path.extension().string();
  if (extension == ".mlp" || extension == ".MLP") {
    if (!scanner_position.empty()) {
      throw InputError(
          "--scanner_position cannot go with a MeshLab project, "
          "whose file has the scanners' poses; give either");
    }
    return {ReadMeshLabProject(path), true};
  }
  LaserScan scan;
  scan.path = path;
  scan.points = ReadPly(path, GeometryContent::kVertices).vertices;
  if (scanner_position.empty()) return {{scan}, false};
  const Eigen::Vector3d scanner(scanner_position.data());
  for (Eigen::Vector3d& x : scan.points) x -= scanner;
  scan.world_from_scan.translation = scanner;
  return {{scan}, true};
}

std::vector<Edge> EdgesOf(const Reconstruction& truth) {
  std::vector<Edge> edges;
  for (const auto& [id, line] : truth.lines3D) edges.push_back({line.start, line.end});
  return edges;
}

std::vector<Edge> EdgesOf(const FileGeometry& geometry) {
  std::vector<Edge> edges;
  for (const auto& [a, b] : geometry.edges) {
    edges.push_back({geometry.vertices[a], geometry.vertices[b]});
  }
  return edges;
}

// Everything is measured in the frame of the truth: a model in another would only show that.
void WarnOfOtherFrame(const Reconstruction& model, const Reconstruction& truth,
                      const GeometryOptions& options) {
  const auto errors = CompareToTruth(model, truth, Sim3d());
  if (!errors.position) return;
  const double max_mm =
      *std::max_element(options.thresholds_mm.begin(), options.thresholds_mm.end());
  const double median_mm = 1000.0 * options.metres_per_unit * errors.position->median;
  if (median_mm > max_mm) {
    LogWarning(
        "The cameras of the model are {:.1f} mm (median) from those of the truth, more than the "
        "largest threshold: --alignment brings the model into the truth's frame",
        median_mm);
  }
}

class EvaluateGeometryJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table->Field("input_path", &input_path_, "Model folder.").Required();
    table->Field("mesh_path", &mesh_path_,
                 "True surface: a PLY or OBJ mesh, in the frame and unit of the model.");
    table->Field("point_cloud_path", &cloud_path_,
                 "True surface, instead: a PLY cloud, or a MeshLab project (.mlp) of laser scans; "
                 "adds accuracy, completeness and F1 as ETH3D's benchmark has them.");
    table->Field("ground_truth_path", &truth_path_,
                 "True model: its lines are true edges, its groups true primitives, its poses are "
                 "for --alignment; or a PLY file with edges.");
    table->Choice(
        "alignment", &frame_,
        {{"none", FrameChoice::kSame},
         {"auto", FrameChoice::kAuto},
         {"centres", FrameChoice::kCentres},
         {"centres_and_points", FrameChoice::kCentresAndPoints}},
        "Similarity that the model is moved by before (none: it is in the truth's frame).");
    table->Field("output_path", &output_path_,
                 "Folder for errors feature by feature: CSV files and a coloured errors.ply.");
    geometry_.Describe(table);
    multi_view_.Describe(table);
    edges_.Describe(table);
    primitives_.Describe(table);
    table
        ->Field("scanner_position", &scanner_position_, AnyValue(),
                "Position x,y,z of the scanner of a PLY cloud, whose beams then show free space.")
        .Advanced();
    table
        ->Field("num_threads", &num_threads_, AtLeast(-1), "Threads (-1: one per hardware thread).")
        .Advanced();
    read_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    ProbeResult();
    if (!output_path_.empty()) ProbeFolder(output_path_, IsGeometryFile);
  }

  void Run(const Invocation& invocation) override {
    CheckOptions();
    Reconstruction model = ReadModel(input_path_, read_);
    GeometryReport report;
    const Reconstruction truth = ReadTruth();
    BringIntoFrame(truth, &model);
    if (!mesh_path_.empty()) {
      const FileGeometry mesh = ReadMesh(mesh_path_);
      MeasureSurface(model, NearestDistance::ToTriangles(mesh.vertices, mesh.triangles), &report);
    }
    if (!cloud_path_.empty()) MeasureCloud(model, &report);
    MeasureTruth(model, truth, &report);
    if (!output_path_.empty()) {
      StagedFolder stage(output_path_);
      StageGeometryFiles(report, model, geometry_, &stage);
      stage.Commit(IsGeometryFile);
      LogInfo("Wrote the errors of each feature to {}", output_path_);
    }
    const nlohmann::ordered_json json =
        GeometryToJson(report, model, truth, geometry_, multi_view_);
    PrintResult(invocation.json ? JsonText(json) : GeometryToText(json));
  }

 private:
  void CheckOptions() const {
    if (mesh_path_.empty() && cloud_path_.empty() && truth_path_.empty()) {
      throw InputError(
          "no truth is given; give --mesh_path, --point_cloud_path or --ground_truth_path");
    }
    if (!mesh_path_.empty() && !cloud_path_.empty()) {
      throw InputError(
          "--mesh_path and --point_cloud_path are two surfaces; give the one to measure against");
    }
    if (geometry_.thresholds_mm.empty())
      throw InputError("--thresholds_mm: expected at least one distance, found none");
    if (multi_view_.tolerances_cm.empty())
      throw InputError("--MultiView.tolerances_cm: expected at least one tolerance, found none");
    if (!scanner_position_.empty() && scanner_position_.size() != 3) {
      throw InputError("--scanner_position: expected 3 numbers x,y,z, found " +
                       std::to_string(scanner_position_.size()));
    }
    if (frame_ != FrameChoice::kSame && (truth_path_.empty() || !TruthIsModel())) {
      throw InputError(
          "--alignment needs true poses; give the folder of a true model as --ground_truth_path");
    }
  }

  bool TruthIsModel() const { return !fs::is_regular_file(truth_path_); }

  // Empty where there is none, or only edges.
  Reconstruction ReadTruth() const {
    return truth_path_.empty() || !TruthIsModel() ? Reconstruction() : ReadPoses(truth_path_);
  }

  void BringIntoFrame(const Reconstruction& truth, Reconstruction* model) const {
    if (truth.images.empty()) return;
    if (frame_ == FrameChoice::kSame) {
      WarnOfOtherFrame(*model, truth, geometry_);
      return;
    }
    const ImagePairing pairing = PairImages(*model, truth);
    ReportPairing(pairing, truth_path_);
    const AlignmentBasis basis = frame_ == FrameChoice::kCentres ? AlignmentBasis::kCentres
                                 : frame_ == FrameChoice::kCentresAndPoints
                                     ? AlignmentBasis::kCentresAndPoints
                                     : AlignmentBasis::kAuto;
    const auto alignment = AlignReconstructions(*model, truth, pairing, basis);
    if (!alignment) {
      throw InputError(truth_path_,
                       "shares no image with the model to align by; give true poses of its images");
    }
    model->Transform(alignment->truth_from_model);
  }

  void MeasureSurface(const Reconstruction& model, const NearestDistance& surface,
                      GeometryReport* report) const {
    report->surface = MeasureGeometry(model, surface, geometry_, num_threads_);
  }

  void MeasureCloud(const Reconstruction& model, GeometryReport* report) const {
    Cloud cloud = ReadCloud(cloud_path_, scanner_position_);
    MeasureSurface(model, NearestDistance::ToPoints(cloud.InWorld()), report);
    // ETH3D's figures are in metres throughout.
    std::vector<TruthScan> scans;
    for (LaserScan& scan : cloud.scans) {
      for (Eigen::Vector3d& x : scan.points) x *= geometry_.metres_per_unit;
      scan.world_from_scan.translation *= geometry_.metres_per_unit;
      scans.push_back({scan.points, scan.world_from_scan, cloud.has_scanner});
    }
    std::vector<Eigen::Vector3d> points;
    for (const PointError& error : report->surface->points) {
      points.push_back(geometry_.metres_per_unit * model.points3D.at(error.point3D_id).xyz);
    }
    report->multi_view = MeasureMultiView(points, scans, multi_view_, num_threads_);
    report->has_free_space = cloud.has_scanner;
  }

  void MeasureTruth(const Reconstruction& model, const Reconstruction& truth,
                    GeometryReport* report) const {
    if (truth_path_.empty()) return;
    const std::vector<Edge> edges =
        TruthIsModel() ? EdgesOf(truth) : EdgesOf(ReadPly(truth_path_, GeometryContent::kEdges));
    if (!edges.empty()) report->edges = MeasureEdges(model, edges, geometry_, edges_, num_threads_);
    if (!truth.groups3D.empty()) {
      report->primitives = MeasurePrimitives(model, truth, Sim3d(), primitives_);
    }
    if (!report->surface && !report->edges && !report->primitives) {
      throw InputError(truth_path_,
                       "has neither lines nor groups to measure against; give --mesh_path or "
                       "--point_cloud_path as well");
    }
  }

  std::string input_path_, mesh_path_, cloud_path_, truth_path_, output_path_;
  FrameChoice frame_ = FrameChoice::kSame;
  GeometryOptions geometry_;
  MultiViewOptions multi_view_;
  EdgeOptions edges_;
  PrimitiveOptions primitives_;
  std::vector<double> scanner_position_;
  int num_threads_ = -1;
  ReadModelOptions read_;
};

}  // namespace

Command EvaluateGeometryCommand() {
  return {
      .name = "evaluate_geometry",
      .summary = "Measure points, lines and primitives against the true scene",
      .details =
          "Of points, how many are within the thresholds of the surface, and their median "
          "distance. "
          "Of lines, in samples along them, the length within (recall, metres) and its share of "
          "all "
          "length (precision); \"lines_limap\" has precision as LIMAP defines it, the share of "
          "lines "
          "with any sample within, of lines that at least 4 images see. docs/evaluate.md has all "
          "definitions. With --json: {\"points\": {\"count\", \"median_mm\", \"inlier_percent\": "
          "{\"1\": ..}}, \"lines\": {\"count\", \"length_m\", \"recall_m\": {..}, "
          "\"precision_percent\": {..}}, \"lines_limap\": {..}, \"multi_view\": "
          "{\"accuracy_percent\", \"completeness_percent\", \"f1_percent\", ..}, \"edges\": {..}, "
          "\"primitives\": {\"SPHERE\": {..}, ..}}, each where its truth is given.",
      .supports_json = true,
      .make_job = [] { return std::make_unique<EvaluateGeometryJob>(); }};
}

}  // namespace holba
