// SPDX-License-Identifier: BSD-3-Clause
// holba bench: the project's benchmarks, as Markdown tables.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/bench/accuracy.h"
#include "apps/bench/local_bench.h"
#include "apps/bench/registration_bench.h"
#if defined(HOLBA_WITH_FRONTEND)
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
  kIterations,
  kWireframeForm,
  kAccuracy,
  kSolver,
  kLocal,
  kVpDetection,
  kTwoView,
  kRegistration,
  kSfm
};
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
    table->Choice("benchmark", &benchmark_,
                  {{"iterations", Benchmark::kIterations},
                   {"wireframe_form", Benchmark::kWireframeForm},
                   {"accuracy", Benchmark::kAccuracy},
                   {"solver", Benchmark::kSolver},
                   {"local", Benchmark::kLocal},
                   {"vp_detection", Benchmark::kVpDetection},
                   {"two_view", Benchmark::kTwoView},
                   {"registration", Benchmark::kRegistration},
                   {"sfm", Benchmark::kSfm}},
                  "Which benchmark (time per iteration of the four configurations; the same of the "
                  "2D and 3D form of the wireframe; errors against the truth; the native solver "
                  "against Ceres; a part of a model against the part alone; vanishing points in "
                  "photographs against labelled ones; relative poses of pairs of views; poses of "
                  "images in a model from points, lines and directions; mapping of synthetic "
                  "databases).");
    table->Field("num_images", &num_images_, AtLeast(10),
                 "Sizes of the scenes, by default 100,200,500,1000; wireframe_form: 100,200,500; "
                 "accuracy, which takes one: 100; local, which takes one: 2000; sfm: 100.");
    table
        ->Choice("scene", &photos_.scene,
                 {{"sphere", PhotoSceneKind::kSphere},
                  {"street", PhotoSceneKind::kStreet},
                  {"collection", PhotoSceneKind::kCollection}},
                 "Scene of the databases of the benchmark sfm.")
        .Advanced();
    table
        ->Field("structures", &structures_,
                "Structure of the mapper in the benchmark sfm, as a list of values of "
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
    table->Field("num_seeds", &num_seeds_, Between(1, 100000),
                 "Scenes of the benchmark accuracy; runs of the benchmark vp_detection; views of "
                 "each case of the benchmark registration.");
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
    table->Field("problems", &problems_,
                 "Problems of the benchmark solver, as a list (bal and local, the files, and cuts "
                 "of them of 12 or 16 images; ring_N, sequence_N, collection_N, random_point_N, "
                 "random_holistic_N, near_point_N, near_holistic_N with N images).");
    table->Field("solvers", &solvers_,
                 "Solvers of the benchmark solver, as a list of beginnings of their names (native, "
                 "ceres_dense, plain_ceres, ...); empty: all.");
    table->Field("threads", &threads_, AtLeast(1), "Numbers of threads in the benchmark solver.");
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
  }

  void Run(const Invocation& invocation) override {
    if (benchmark_ == Benchmark::kAccuracy) {
      RunAccuracy(invocation);
    } else if (benchmark_ == Benchmark::kSolver) {
      RunSolverBench(invocation);
    } else if (benchmark_ == Benchmark::kLocal) {
      RunLocal(invocation);
    } else if (benchmark_ == Benchmark::kVpDetection) {
      RunVpDetection(invocation);
    } else if (benchmark_ == Benchmark::kTwoView) {
      RunTwoView(invocation);
    } else if (benchmark_ == Benchmark::kRegistration) {
      RunRegistration(invocation);
    } else if (benchmark_ == Benchmark::kSfm) {
      RunSfm(invocation);
    } else {
      RunTiming(invocation);
    }
  }

 private:
  std::vector<int> Sizes(std::vector<double> defaults) const {
    return WholeNumbers("num_images", num_images_.empty() ? defaults : num_images_, 10);
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
    options.num_seeds = num_seeds_;
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
    options.num_seeds = num_seeds_;
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
    const Table table = RegistrationTable(registration_, static_cast<size_t>(num_seeds_),
                                          focal_is_known_, scene_.seed);
    nlohmann::json rows = nlohmann::json::array();
    for (const std::vector<std::string>& row : table.rows) rows.push_back(row);
    Print(invocation, {table}, rows);
  }

  void RunSfm([[maybe_unused]] const Invocation& invocation) const {
#if defined(HOLBA_WITH_FRONTEND)
    SfmBenchOptions options;
    options.photos = photos_;
    options.photos.seed = scene_.seed;
    options.num_images = Sizes({100});
    options.structures = SplitAtCommas(structures_);
    options.num_threads = solver_.num_threads;
    options.page_path = page_path_.empty() ? TemporaryPage().string() : page_path_;
    const SfmBenchReport report = BenchSfm(options);
    Print(invocation, report.tables, report.results);
#else
    throw InputError("--benchmark: sfm must have the mapper; build with HOLBA_WITH_FRONTEND=ON");
#endif
  }

  void RunTiming(const Invocation& invocation) const {
    TimingOptions options;
    options.num_images = benchmark_ == Benchmark::kIterations ? Sizes({100, 200, 500, 1000})
                                                              : Sizes({100, 200, 500});
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
        benchmark_ == Benchmark::kIterations ? ConfigCases(bundle_) : WireframeFormCases(bundle_);
    const std::vector<Timing> timings = TimeIterations(options, cases);
    Print(invocation, TimingTables(options, cases, timings), TimingsToJson(timings));
  }

  static void Print(const Invocation& invocation, const std::vector<Table>& tables,
                    const nlohmann::json& results) {
    std::string text;
    for (const Table& table : tables) text += (text.empty() ? "" : "\n") + table.Markdown();
    PrintResult(invocation.json ? JsonText({{"results", results}}) : text);
  }

  Benchmark benchmark_ = Benchmark::kIterations;
  std::vector<double> num_images_;
  BundleProblemOptions scene_;
  VisibilityChoice visibility_ = VisibilityChoice::kDefault;
  SchurChoice schur_ = SchurChoice::kBoth;
  int num_seeds_ = 10;
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
          "Scenes are those of `holba synthesize`. Tables are printed as Markdown, with --json the "
          "results as one object.\n\n"
          "iterations, wireframe_form: exactly --iterations iterations from the start with all "
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
          "sfm: `holba map` on databases of --num_images images as `holba synthesize "
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
