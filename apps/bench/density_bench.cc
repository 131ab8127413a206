// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/density_bench.h"

#include <limits>
#include <string>
#include <utility>

#include "apps/bench/plot.h"
#include "holba/base/log.h"
#include "holba/bundle/bundle_problem.h"

namespace holba {
namespace {

struct DensityScene {
  PhotoSceneKind kind;
  const char* name;
};
constexpr DensityScene kDensityScenes[] = {{PhotoSceneKind::kSphere, "sphere"},
                                           {PhotoSceneKind::kStreet, "street"},
                                           {PhotoSceneKind::kCollection, "collection"}};

}  // namespace

std::vector<double> DensityOf(const Reconstruction& model, const BundleOptions& given) {
  BundleOptions bundle = given;
  bundle.config = BundleConfig::kHolistic;
  bundle.gauge = Gauge::kFree;  // a frame that is held has no block, and would not be counted
  const ReducedSystem system = AnalyseReducedSystem(BuildProblem(model, bundle).problem);
  const double without = system.pose_density_without_wireframe, with = system.pose_density;
  return {
      static_cast<double>(model.images.size()),
      static_cast<double>(model.points3D.size()),
      static_cast<double>(model.lines3D.size()),
      static_cast<double>(model.wireframe.size()),
      100.0 * without,
      100.0 * with,
      without > 0.0 ? 100.0 * (with / without - 1.0) : std::numeric_limits<double>::quiet_NaN()};
}

PaperBenchReport BenchDensity(const PaperBenchOptions& options, const PhotoSetOptions& given,
                              const BundleOptions& bundle) {
  std::vector<std::string> rows;
  for (const DensityScene& scene : kDensityScenes) rows.emplace_back(scene.name);
  SeedTable table("density", "Pairs of cameras that the reduced system couples:", rows,
                  options.SeedNames(),
                  {{"images", BetterIs::kNeither, 0},
                   {"points", BetterIs::kNeither, 0},
                   {"lines", BetterIs::kNeither, 0},
                   {"edges", BetterIs::kNeither, 0},
                   {"without wireframe, %", BetterIs::kNeither, 1},
                   {"with it, %", BetterIs::kNeither, 1},
                   {"more by, %", BetterIs::kNeither, 1}});
  for (size_t s = 0; s < table.cases.size(); ++s) {
    for (size_t r = 0; r < table.rows.size(); ++r) {
      PhotoSetOptions photos = given;
      photos.scene = kDensityScenes[r].kind;
      photos.seed = options.seed + s;
      photos.num_images = options.NumImages(50, 200, 900);
      photos.num_threads = options.num_threads;
      // The truth does not see them.
      photos.wrong_matches = photos.wrong_line_matches = 0.0;
      table.Set(r, s, DensityOf(MakePhotoSet(photos).truth, bundle));
      LogInfo("{}, seed {} of {}", table.rows[r], s + 1, table.cases.size());
    }
  }
  PaperBenchReport report;
  report.plot = DotPlot(table);
  report.tables = {std::move(table)};
  return report;
}

}  // namespace holba
