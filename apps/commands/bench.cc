// SPDX-License-Identifier: BSD-3-Clause
// holba bench: the project's benchmarks, as Markdown tables.
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "apps/bench/accuracy.h"
#include "apps/bench/density_bench.h"
#include "apps/bench/local_bench.h"
#include "apps/bench/registration_bench.h"
#include "apps/bench/results_page.h"
#if defined(HOLBA_WITH_FRONTEND)
#include "apps/bench/rendered_bench.h"
#include "apps/bench/sfm_bench.h"
#endif
#include "apps/bench/solver_bench.h"
#include "apps/bench/timing.h"
#include "apps/bench/two_view_bench.h"
#include "apps/bench/vp_detection.h"
#include "apps/command.h"
#include "apps/view/open_in_browser.h"
#include "holba/base/error.h"
#include "holba/io/files.h"
#include "holba/synthetic/photo_set.h"

namespace holba {
namespace {

enum class Benchmark {
  kScaling,
  kWireframe,
  kBreakdown,
  kSfm,
  kGeometry,
  kPoses,
  kAblation,
  kDensity,
  kPrimitives,
  kReport,
  kAccuracy,
  kSolver,
  kLocal,
  kVpDetection,
  kTwoView,
  kRegistration
};
// By the name on the command line; the first ones are the paper's tables and figures.
const std::vector<std::pair<std::string, Benchmark>>& Benchmarks() {
  static const std::vector<std::pair<std::string, Benchmark>> all = {
      {"scaling", Benchmark::kScaling},       {"wireframe", Benchmark::kWireframe},
      {"breakdown", Benchmark::kBreakdown},   {"sfm", Benchmark::kSfm},
      {"geometry", Benchmark::kGeometry},     {"poses", Benchmark::kPoses},
      {"ablation", Benchmark::kAblation},     {"density", Benchmark::kDensity},
      {"primitives", Benchmark::kPrimitives}, {"report", Benchmark::kReport},
      {"accuracy", Benchmark::kAccuracy},     {"solver", Benchmark::kSolver},
      {"local", Benchmark::kLocal},           {"vp_detection", Benchmark::kVpDetection},
      {"two_view", Benchmark::kTwoView},      {"registration", Benchmark::kRegistration}};
  return all;
}
enum class VisibilityChoice { kDefault, kRandom, kNear, kCluster, kBoth };
enum class SchurChoice { kDense, kSparse, kBoth };

std::vector<std::string> SplitAtCommas(const std::string& text) {
  std::vector<std::string> parts;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    if (end > begin) parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

class BenchJob : public Job {
 public:
  BenchJob() {
    // The scenes' noise is Gaussian and their intrinsics are known; one thread repeats.
    bundle_[TermFamily::kPoint].loss = bundle_[TermFamily::kLine].loss = LossChoice::kTrivial;
    bundle_.refine_focal_length = bundle_.refine_extra_params = false;
    solver_.num_threads = 1;
    // Views of it may show as few points as determine a pose, and have the intrinsics they have.
    registration_.abs_pose_min_num_inliers = 3;
    registration_.abs_pose_refine_focal_length = registration_.abs_pose_refine_extra_params = false;
  }

  void Describe(OptionTable* table) const override {
    table->Choice("benchmark", &benchmark_, Benchmarks(),
                  "Which table or figure of the paper, or other benchmark (above).");
    table->Choice("size", &paper_.size,
                  {{"small", BenchSize::kSmall},
                   {"medium", BenchSize::kMedium},
                   {"paper", BenchSize::kPaper}},
                  "Size of the paper's tables and figures: seconds, minutes, or the paper's own "
                  "numbers of images.");
    table->Field(
        "output_path", &output_path_,
        "Folder for NAME.json and the plot NAME.svg (of the paper's tables and figures; of "
        "report, the file of the page).");
    table->Field("work_path", &paper_.work_path,
                 "Folder where rendered places stay for the next run (empty: none).");
    table->Field(
        "num_images", &num_images_, AtLeast(10),
        "Sizes of the scenes (of scaling, wireframe, breakdown and sfm a list; default: by "
        "--size, accuracy 100, local 2000).");
    table
        ->Choice("scene", &photos_.scene,
                 {{"sphere", PhotoSceneKind::kSphere},
                  {"street", PhotoSceneKind::kStreet},
                  {"collection", PhotoSceneKind::kCollection}},
                 "Scene of the databases of the benchmark sfm.")
        .Advanced();
    table
        ->Field(
            "structures", &structures_,
            "Structure of the mapper in the benchmarks sfm and breakdown, as a list of values of "
            "--Mapper.structure.")
        .Advanced();
    table
        ->Field("page_path", &page_path_,
                "HTML page of the last model of the benchmark sfm beside the truth; empty: one in "
                "a temporary place.")
        .Advanced();
    table->Field("seed", &scene_.seed, AnyValue(), "First seed of the scenes.");
    table
        ->Choice("visibility", &visibility_,
                 {{"default", VisibilityChoice::kDefault},
                  {"random", VisibilityChoice::kRandom},
                  {"near", VisibilityChoice::kNear},
                  {"cluster", VisibilityChoice::kCluster},
                  {"both", VisibilityChoice::kBoth}},
                 "Which cameras see a feature: any 4 to 8, ones next to each other in the "
                 "sequence (near) or in space (cluster), or random and then near (both); default: "
                 "random for times, both for accuracy.")
        .Advanced();
    table
        ->Choice("layout", &scene_.layout,
                 {{"sphere", SceneLayout::kSphere}, {"corridor", SceneLayout::kCorridor}},
                 "Where the cameras are (on a sphere around a cube, or in a row along a "
                 "corridor).")
        .Advanced();
    table->Field("vps", &scene_.vps, "Add vanishing points and relations to the scenes.")
        .Advanced();
    table
        ->Field("fraction_wrong_associations", &scene_.fraction_wrong_associations, Between(0, 0.9),
                "Share of wrong group members and wireframe edges.")
        .Advanced();
    table
        ->Choice("wrong_associations", &scene_.wrong_associations,
                 {{"random", WrongAssociations::kRandom}, {"nearest", WrongAssociations::kNearest}},
                 "Whether a wrong association is to any feature or to the nearest wrong one.")
        .Advanced();
    table->Field(
        "num_seeds", &num_seeds_, Between(0, 100000),
        "Scenes or seeds (of vp_detection runs, of registration views of each case; 0: 10, of "
        "the paper's tables 2, 5 or 8 by --size).");
    table->Field("data", &data_path_,
                 "Folder of labelled photographs of the benchmark vp_detection (YUD+).");
    table
        ->Choice("alignment", &alignment_,
                 {{"auto", AlignmentBasis::kAuto},
                  {"centres", AlignmentBasis::kCentres},
                  {"centres_and_points", AlignmentBasis::kCentresAndPoints}},
                 "What aligns a result with the truth in the benchmark accuracy.")
        .Advanced();
    table
        ->Choice("statistic", &median_, {{"rms", false}, {"median", true}},
                 "What sums up the errors of one scene in the benchmark accuracy.")
        .Advanced();
    table->Field("iterations", &iterations_, AtLeast(2),
                 "Iterations timed in one run; the first one is left out.");
    table->Field("repetitions", &repetitions_, AtLeast(1),
                 "Runs of each case, of which the fastest median counts.");
    table
        ->Field("max_repeated_seconds", &max_repeated_seconds_, AtLeast(0),
                "Runs that take longer are not repeated.")
        .Advanced();
    table
        ->Choice("clock", &clock_, {{"wall", TimingClock::kWall}, {"cpu", TimingClock::kCpu}},
                 "Wall time, or processor time of all threads: with one thread (also "
                 "OPENBLAS_NUM_THREADS=1) it shows the same on a busy machine.")
        .Advanced();
    table
        ->Choice("schur", &schur_,
                 {{"dense", SchurChoice::kDense},
                  {"sparse", SchurChoice::kSparse},
                  {"both", SchurChoice::kBoth}},
                 "How the reduced systems of the timed cases are solved.")
        .Advanced();
    table->Field("input_path", &input_path_,
                 "BAL problems of the benchmark solver, as a list a,b,c of files; pairs of the "
                 "benchmark two_view, views of the benchmark registration, a file.");
    table
        ->Field("problems", &problems_,
                "Problems of the benchmark solver, as a list (bal and local, the files, and cuts "
                "of them of 12 or 16 images; ring_N, sequence_N, collection_N, random_point_N, "
                "random_holistic_N, near_point_N, near_holistic_N with N images).")
        .Advanced();
    table
        ->Field("solvers", &solvers_,
                "Solvers of the benchmark solver, as a list of beginnings of their names (native, "
                "ceres_dense, plain_ceres, ...); empty: all.")
        .Advanced();
    table->Field("threads", &threads_, AtLeast(1), "Numbers of threads in the benchmark solver.")
        .Advanced();
    table
        ->Field("camera_per_image", &camera_per_image_,
                "Each image of sequences and collections has a camera of its own, which is "
                "adjusted, instead of one for all.")
        .Advanced();
    table
        ->Field("calls", &calls_, AtLeast(0),
                "Adjustments in a row of the problems `local`; 0: none.")
        .Advanced();
    table
        ->Field("max_run_seconds", &max_run_seconds_, GreaterThan(0),
                "A run of the benchmark solver stops after the iteration that passes this.")
        .Advanced();
    bundle_.Describe(table);
    solver_.Describe(table);
    vanishing_points_.Describe(table);
    two_view_.Describe(table);
    table->Section("");
    table
        ->Field("focal_is_known", &focal_is_known_,
                "Whether the benchmark registration gives the images' focal length.")
        .Advanced();
    registration_.Describe(table);
    photos_.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    if (!page_path_.empty()) ProbeFile(page_path_);
    ProbeResult();
    if (output_path_.empty()) return;
    if (benchmark_ == Benchmark::kReport) {
      ProbeFile(output_path_);
    } else {
      ProbeFolder(output_path_, [this](std::string_view name) { return IsOfResult(name); });
    }
  }

  void Run(const Invocation& invocation) override {
    switch (benchmark_) {
      case Benchmark::kScaling:
      case Benchmark::kWireframe:
        return RunTiming(invocation);
      case Benchmark::kBreakdown:
      case Benchmark::kSfm:
        return RunSfm(invocation);
      case Benchmark::kGeometry:
      case Benchmark::kPoses:
      case Benchmark::kAblation:
      case Benchmark::kPrimitives:
        return RunRendered(invocation);
      case Benchmark::kDensity:
        return Print(invocation, BenchDensity(PaperOptions(), photos_, bundle_));
      case Benchmark::kReport:
        return RunReport(invocation);
      case Benchmark::kAccuracy:
        return RunAccuracy(invocation);
      case Benchmark::kSolver:
        return RunSolverBench(invocation);
      case Benchmark::kLocal:
        return RunLocal(invocation);
      case Benchmark::kVpDetection:
        return RunVpDetection(invocation);
      case Benchmark::kTwoView:
        return RunTwoView(invocation);
      case Benchmark::kRegistration:
        return RunRegistration(invocation);
    }
  }

 private:
  std::vector<int> Sizes(std::vector<double> defaults) const {
    return WholeNumbers("num_images", num_images_.empty() ? defaults : num_images_, 10);
  }

  int NumSeeds() const { return num_seeds_ > 0 ? num_seeds_ : 10; }

  std::string NameOfBenchmark() const {
    for (const auto& [name, benchmark] : Benchmarks())
      if (benchmark == benchmark_) return name;
    return "";
  }

  bool IsOfResult(std::string_view name) const {
    return name == NameOfBenchmark() + ".json" || name == NameOfBenchmark() + ".svg";
  }

  // Of the paper's tables and figures.
  PaperBenchOptions PaperOptions() const {
    PaperBenchOptions options = paper_;
    options.seed = scene_.seed;
    options.num_seeds = num_seeds_;
    options.num_images = WholeNumbers("num_images", num_images_, 10);
    options.num_threads = solver_.num_threads;
    return options;
  }

  Visibility SingleVisibility() const {
    if (visibility_ == VisibilityChoice::kNear) return Visibility::kNear;
    if (visibility_ == VisibilityChoice::kCluster) return Visibility::kCluster;
    return Visibility::kRandom;
  }

  void RunAccuracy(const Invocation& invocation) const {
    AccuracyOptions options;
    const std::vector<int> sizes = Sizes({100});
    if (sizes.size() != 1)
      throw InputError(
          "--num_images: expected one number for the benchmark accuracy, found several");
    options.scene = scene_;
    options.scene.num_images = sizes[0];
    if (visibility_ == VisibilityChoice::kDefault || visibility_ == VisibilityChoice::kBoth) {
      options.visibilities = {Visibility::kRandom, Visibility::kNear};
    } else {
      options.visibilities = {SingleVisibility()};
    }
    options.num_seeds = NumSeeds();
    options.bundle = bundle_;
    options.solver = solver_;
    options.alignment = alignment_;
    options.median = median_;
    const std::vector<AccuracyResult> results = MeasureAccuracy(options);
    Print(invocation, AccuracyTables(options, results), AccuracyToJson(results));
  }

  void RunSolverBench(const Invocation& invocation) const {
    SolverBenchOptions options;
    options.problems.names = SplitAtCommas(problems_);
    options.problems.bal_paths = SplitAtCommas(input_path_);
    options.problems.bundle = bundle_;
    options.problems.seed = scene_.seed;
    options.problems.camera_per_image = camera_per_image_;
    const std::vector<int> threads = WholeNumbers("threads", threads_, 1);
    const std::vector<std::string> solvers = SplitAtCommas(solvers_);
    options.competitors = Competitors(threads, solvers);
    options.iterations = iterations_;
    options.repetitions = repetitions_;
    options.max_repeated_seconds = max_repeated_seconds_;
    options.max_run_seconds = max_run_seconds_;
    options.calls = calls_;
    options.solver = solver_;
    const SolverBenchResult result = BenchSolvers(options);
    Print(invocation, SolverTables(result), SolverBenchToJson(result));
  }

  void RunLocal(const Invocation& invocation) const {
    LocalBenchOptions options;
    if (!num_images_.empty())
      options.num_images = WholeNumbers("num_images", num_images_, options.part_images);
    options.seed = scene_.seed;
    options.bundle = bundle_;
    options.solver = solver_;
    const std::vector<LocalBenchResult> results = BenchLocal(options);
    Print(invocation, LocalTables(options, results), LocalBenchToJson(results));
  }

  void RunVpDetection(const Invocation& invocation) const {
    if (data_path_.empty()) {
      throw InputError(
          "--data: the benchmark vp_detection must have a folder of labelled photographs");
    }
    VpDetectionOptions options;
    options.detection = vanishing_points_;
    options.num_seeds = NumSeeds();
    const std::vector<VpDetectionResult> results =
        MeasureVpDetection(options, ReadLabelledSegments(data_path_));
    Print(invocation, {VpDetectionTable(results)}, VpDetectionToJson(results));
  }

  void RunTwoView(const Invocation& invocation) const {
    if (input_path_.empty()) {
      throw InputError(
          "--input_path: the benchmark two_view must have a file of pairs, as "
          "benchmark/two_view.py makes them");
    }
    const auto results = EstimateRelativePoses(two_view_, ReadMatchedPairs(input_path_));
    Print(invocation, {RelativePoseTable(results)}, RelativePosesToJson(results));
  }

  void RunRegistration(const Invocation& invocation) const {
    if (!input_path_.empty()) {
      const auto results =
          EstimatePoses(registration_, ReadRegistrationViews(input_path_), scene_.seed);
      return Print(invocation, {RegistrationSummary(results)}, RegistrationsToJson(results));
    }
    const Table table = RegistrationTable(registration_, static_cast<size_t>(NumSeeds()),
                                          focal_is_known_, scene_.seed);
    nlohmann::json rows = nlohmann::json::array();
    for (const std::vector<std::string>& row : table.rows) rows.push_back(row);
    Print(invocation, {table}, rows);
  }

  void RunSfm([[maybe_unused]] const Invocation& invocation) const {
#if defined(HOLBA_WITH_FRONTEND)
    SfmBenchOptions options;
    options.bench = PaperOptions();
    options.photos = photos_;
    options.structures = SplitAtCommas(structures_);
    if (benchmark_ != Benchmark::kSfm) return Print(invocation, BenchBreakdown(options));
    options.page_path = page_path_.empty() ? TemporaryPage().string() : page_path_;
    Print(invocation, BenchSfm(options));
#else
    RefuseWithoutFrontend();
#endif
  }

  void RunRendered([[maybe_unused]] const Invocation& invocation) const {
#if defined(HOLBA_WITH_FRONTEND)
    const PaperBenchOptions options = PaperOptions();
    Print(invocation, benchmark_ == Benchmark::kGeometry   ? BenchGeometry(options)
                      : benchmark_ == Benchmark::kPoses    ? BenchPoses(options)
                      : benchmark_ == Benchmark::kAblation ? BenchAblation(options)
                                                           : BenchPrimitives(options));
#else
    RefuseWithoutFrontend();
#endif
  }

#if !defined(HOLBA_WITH_FRONTEND)
  [[noreturn]] void RefuseWithoutFrontend() const {
    throw InputError("--benchmark: " + NameOfBenchmark() +
                     " must have photographs and the mapper; build with HOLBA_WITH_FRONTEND=ON");
  }
#endif

  void RunReport(const Invocation& invocation) const {
    if (input_path_.empty()) {
      throw InputError(
          "--input_path: report must have the folder that the benchmarks wrote their results to");
    }
    const std::filesystem::path page_folder =
        output_path_.empty() ? "." : std::filesystem::absolute(output_path_).parent_path();
    const std::string plots = std::filesystem::relative(input_path_, page_folder).generic_string();
    const std::string page = ResultsPage(ReadResults(input_path_), plots);
    if (output_path_.empty()) {
      PrintResult(invocation.json ? JsonText({{"page", page}}) : page);
    } else {
      WriteFileWhole(output_path_, [&](std::ostream* stream) { *stream << page; });
    }
  }

  void RunTiming(const Invocation& invocation) const {
    TimingOptions options;
    const PaperBenchOptions paper = PaperOptions();
    options.num_images = paper.num_images;
    if (options.num_images.empty()) {
      options.num_images = paper.size == BenchSize::kSmall ? std::vector<int>{10, 20, 40}
                           : paper.size == BenchSize::kMedium
                               ? std::vector<int>{100, 200, 400}
                               : std::vector<int>{100, 200, 500, 1000, 2000};
    }
    if (schur_ != SchurChoice::kDense) options.linear_solvers.push_back(LinearSolver::kSparse);
    if (schur_ != SchurChoice::kSparse) options.linear_solvers.push_back(LinearSolver::kDense);
    options.iterations = iterations_;
    options.repetitions = repetitions_;
    options.max_repeated_seconds = max_repeated_seconds_;
    options.clock = clock_;
    options.scene = scene_;
    if (visibility_ == VisibilityChoice::kBoth)
      throw InputError("--visibility: expected one visibility, of which the times are, found both");
    options.scene.visibility = SingleVisibility();
    options.solver = solver_;
    const std::vector<TimingCase> cases =
        benchmark_ == Benchmark::kScaling ? ConfigCases(bundle_) : WireframeFormCases(bundle_);
    std::vector<std::vector<Timing>> of_seeds;
    for (int s = 0; s < paper.NumSeeds(); ++s) {
      TimingOptions of_seed = options;
      of_seed.scene.seed += static_cast<uint64_t>(s);
      of_seeds.push_back(TimeIterations(of_seed, cases));
    }
    Print(invocation, TimingReport(NameOfBenchmark(), options, cases, of_seeds));
  }

  // A table or figure of the paper: also as files.
  void Print(const Invocation& invocation, const PaperBenchReport& report) const {
    const nlohmann::ordered_json json = PaperBenchToJson(NameOfBenchmark(), report);
    if (!output_path_.empty()) {
      StagedFolder stage(output_path_);
      stage.Write(NameOfBenchmark() + ".json",
                  [&](std::ostream* stream) { *stream << json.dump(1) << "\n"; });
      stage.Write(NameOfBenchmark() + ".svg",
                  [&](std::ostream* stream) { *stream << report.plot; });
      stage.Commit([this](std::string_view name) { return IsOfResult(name); });
    }
    std::vector<Table> tables;
    for (const SeedTable& table : report.tables) {
      for (Table& part : TablesOf(table)) tables.push_back(std::move(part));
    }
    Print(invocation, tables, json);
  }

  static void Print(const Invocation& invocation, const std::vector<Table>& tables,
                    const nlohmann::json& results) {
    std::string text;
    for (const Table& table : tables) text += (text.empty() ? "" : "\n") + table.Markdown();
    PrintResult(invocation.json ? JsonText({{"results", results}}) : text);
  }

  Benchmark benchmark_ = Benchmark::kScaling;
  PaperBenchOptions paper_;
  std::string output_path_;
  std::vector<double> num_images_;
  BundleProblemOptions scene_;
  VisibilityChoice visibility_ = VisibilityChoice::kDefault;
  SchurChoice schur_ = SchurChoice::kBoth;
  int num_seeds_ = 0;
  int iterations_ = 20;
  int repetitions_ = 3;
  double max_repeated_seconds_ = 60.0;
  TimingClock clock_ = TimingClock::kWall;
  AlignmentBasis alignment_ = AlignmentBasis::kAuto;
  bool median_ = false;
  std::string input_path_;
  std::string data_path_;
  std::string problems_ =
      "bal,local,ring_100,ring_500,sequence_500,collection_200,random_holistic_100,"
      "near_holistic_100";
  std::string solvers_;
  std::vector<double> threads_ = {1, 2};
  std::string structures_ = "none,lines,groups,holistic", page_path_;
  bool camera_per_image_ = false;
  int calls_ = 200;
  double max_run_seconds_ = 120.0;
  BundleOptions bundle_;
  SolverOptions solver_;
  VanishingPointOptions vanishing_points_;
  TwoViewOptions two_view_;
  AbsolutePoseOptions registration_;
  bool focal_is_known_ = true;
  PhotoSetOptions photos_;
};

}  // namespace

Command BenchCommand() {
  return {
      .name = "bench",
      .summary = "Measure speed and accuracy",
      .details =
          "The paper's tables and figures, over several seeds or scenes (scaling, wireframe, "
          "breakdown, sfm, geometry, poses, ablation, density, primitives), their page (report), "
          "and others.\n\n"
          "scaling, wireframe: time of one iteration by size of the problem, of the four "
          "configurations, and of the 2D and 3D form of the wireframe (runtime figures a and "
          "b).\n\n"
          "breakdown: first and later iterations of the mapper's adjustments (figure c); sfm: the "
          "mapper on synthetic databases (Table 1).\n\n"
          "geometry: points and lines of rendered rooms against their surfaces with groups and "
          "wireframe on and off (Tables 2 and 3).\n\n"
          "poses: cameras of rendered rooms by points, points and lines, all structure (Table 4); "
          "ablation: the 2D form against the 3D form with weights 1 to 1000 (Table 5).\n\n"
          "density: coupled pairs of cameras without and with the wireframe; primitives: objects "
          "of "
          "label maps on rendered tables against the truth.\n\n"
          "report: docs/results.md from the files of --input_path that these wrote to "
          "--output_path.\n\n"
          "Others: accuracy (errors against the truth), solver (the native solver against Ceres), "
          "local (a part of a model against the part alone), vp_detection (vanishing points in "
          "labelled photographs), two_view (relative poses of pairs), registration (poses of "
          "images "
          "in a model).\n\n"
          "Scenes are those of `holba synthesize`, places those of `holba render`. Tables are "
          "printed as Markdown, with --json the results as one object.\n\n"
          "scaling, wireframe: exactly --iterations iterations from the start with all "
          "tolerances 0; all cases of one size are run in turn, and the turns repeated. A time is "
          "the least over the repetitions of the median over the accepted iterations after the "
          "first.\n\n"
          "accuracy: adjusts --num_seeds scenes with every configuration, and with Holistic at "
          "weights 5 for members of groups and 1 for the wireframe. Rows without lines or planes "
          "estimate them afterwards with the cameras held.\n\n"
          "solver: the native solver against Ceres, as holba's backend and, for BAL problems, as a "
          "program of its own with one block for each camera (plain_ceres). Every run is a process "
          "of its own; all solvers run in turn, and the turns are repeated. Each runs --iterations "
          "iterations for the time of one, and at most 50 until the cost changes by less than 1e-9 "
          "of itself for the time to 1 % and 0.1 % above the least cost that any of them found. "
          "Calls have at most 25 iterations and the tolerances of the options; each is of a "
          "problem "
          "that differs a little from the last one. Covariances are the native solver's, after "
          "--iterations iterations with the gauge fixed. Not run, and shown "
          "as skipped: dense systems above 6000 unknowns, factorised by Eigen above 3000. Times "
          "stand beside a floor: the operations that the step needs at the machine's peak.\n\n"
          "local: 12 images in a row of a street of --num_images images, the observations in other "
          "images left out, adjusted in the model and as a model of their own: selecting, "
          "building, solving, writing back.\n\n"
          "vp_detection: vanishing points found in the segments of each photograph against the "
          "labelled ones, for --num_seeds seeds of the detection: the part of the labelled "
          "directions that have a found one within 2, 5 and 10 degrees, found ones more than 5 "
          "degrees from every labelled one, and segments given to a direction within 5 degrees of "
          "their label's.\n\n"
          "two_view: the essential matrix of each pair of --input_path, with the options "
          "TwoViewGeometry, and the pose in it; processor time of one thread.\n\n"
          "registration: images of a room of 5 units, 1 px of noise, from points of which fewer "
          "and "
          "fewer are seen and more and more are wrong, alone, with 20 lines of which as many are "
          "wrong, and with 3 vanishing directions of which nobody knows which is which; "
          "--num_seeds images of each. Shown: images within 2 degrees and 0.1 units of the truth, "
          "the median error of the centre in units, and processor time. Or the views of "
          "--input_path.\n\n"
          "sfm, breakdown: `holba map` on databases of --num_images images as `holba synthesize "
          "--database_path` makes them (--scene, --seed, --Database.*), with each of --structures: "
          "adjustments and their iterations, what was reconstructed, pose AUC against the "
          "truth.\n\n"
          "What a benchmark compares, it sets itself: Bundle.config, and for times "
          "Bundle.wireframe_form, Solver.linear_solver, the tolerances and "
          "Solver.max_num_iterations. A point or line loss auto counts as Cauchy at its scale in "
          "times.",
      .supports_json = true,
      .make_job = [] { return std::make_unique<BenchJob>(); }};
}

}  // namespace holba
