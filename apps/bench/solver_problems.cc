// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/solver_problems.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

#include "holba/base/error.h"
#include "holba/camera/snavely.h"
#include "holba/io/bal.h"
#include "holba/synthetic/bundle_problem.h"
#include "holba/synthetic/point_graph.h"

namespace holba {
namespace {

// "problem-49-7776-pre.txt" is called 49-7776.
std::string NameOfBalFile(const std::string& path) {
  std::string name = std::filesystem::path(path).stem().string();
  if (name.starts_with("problem-")) name = name.substr(8);
  if (name.ends_with("-pre")) name = name.substr(0, name.size() - 4);
  return name;
}

// All that a BAL problem leaves free. The free gauge is what a plain program for it has.
BundleOptions BalBundle(BundleOptions bundle) {
  bundle.config = BundleConfig::kPoint;
  bundle.gauge = Gauge::kFree;
  bundle.refine_focal_length = bundle.refine_extra_params = true;
  bundle.refine_principal_point = false;
  return bundle;
}

SolverProblem MakeBal(const SolverProblemOptions& options, const std::string& path) {
  return {"bal_" + NameOfBalFile(path), ReadBal(path), BalBundle(options.bundle)};
}

// 12 images of a problem with many of them, 16 of one with few.
std::string LocalName(const std::string& path) { return "local_" + NameOfBalFile(path); }
SolverProblem MakeLocal(const SolverProblemOptions& options, const std::string& path) {
  constexpr size_t kMaxPoints = 3000;
  const Reconstruction whole = ReadBal(path);
  return {LocalName(path), LocalCut(whole, whole.images.size() > 30 ? 12 : 16, kMaxPoints),
          BalBundle(options.bundle), true};
}

SolverProblem MakeScene(const SolverProblemOptions& options, const std::string& name,
                        int num_images, Visibility visibility, BundleConfig config) {
  BundleProblemOptions scene;
  scene.seed = options.seed;
  scene.num_images = num_images;
  scene.visibility = visibility;
  SolverProblem problem = {name, MakeBundleProblem(scene).perturbed, options.bundle};
  problem.bundle.config = config;
  return problem;
}

SolverProblem MakeGraph(const SolverProblemOptions& options, const std::string& name,
                        int num_images, PointGraphKind kind) {
  PointGraphOptions graph;
  graph.kind = kind;
  graph.seed = options.seed;
  graph.num_images = num_images;
  graph.observations_per_image =
      ObservationsPerImage(kind == PointGraphKind::kCollection, num_images);
  graph.camera_per_image = options.camera_per_image;
  SolverProblem problem = {name, MakePointGraph(graph).perturbed, options.bundle};
  problem.bundle.config = BundleConfig::kPoint;
  if (options.camera_per_image) {
    problem.bundle.refine_focal_length = problem.bundle.refine_extra_params = true;
  }
  return problem;
}

using Maker = std::function<SolverProblem(const SolverProblemOptions&, const std::string&, int)>;
struct Family {
  std::string_view prefix;
  int min_images;
  Maker make;
};
const std::vector<Family>& Families() {
  const auto scene = [](Visibility visibility, BundleConfig config) -> Maker {
    return [=](const SolverProblemOptions& options, const std::string& name, int num_images) {
      return MakeScene(options, name, num_images, visibility, config);
    };
  };
  const auto graph = [](PointGraphKind kind) -> Maker {
    return [=](const SolverProblemOptions& options, const std::string& name, int num_images) {
      return MakeGraph(options, name, num_images, kind);
    };
  };
  static const std::vector<Family> families = {
      {"ring_", 10, scene(Visibility::kRandom, BundleConfig::kPoint)},
      {"sequence_", 4, graph(PointGraphKind::kSequence)},
      {"collection_", 4, graph(PointGraphKind::kCollection)},
      {"random_point_", 10, scene(Visibility::kRandom, BundleConfig::kPoint)},
      {"random_holistic_", 10, scene(Visibility::kRandom, BundleConfig::kHolistic)},
      {"near_point_", 10, scene(Visibility::kNear, BundleConfig::kPoint)},
      {"near_holistic_", 10, scene(Visibility::kNear, BundleConfig::kHolistic)}};
  return families;
}

SolverProblemSource MakeSource(const SolverProblemOptions& options, const std::string& name) {
  for (const Family& family : Families()) {
    if (!name.starts_with(family.prefix)) continue;
    const std::string_view number = std::string_view(name).substr(family.prefix.size());
    int num_images = 0;
    const auto [end, error] =
        std::from_chars(number.data(), number.data() + number.size(), num_images);
    if (error != std::errc() || end != number.data() + number.size() ||
        num_images < family.min_images) {
      throw InputError(fmt::format(
          "--problems: expected a number of at least {1} images after '{2}', found '{0}'", name,
          family.min_images, family.prefix));
    }
    return {name, [options, name, num_images, make = family.make] {
              return make(options, name, num_images);
            }};
  }
  std::string known = "bal, local";
  for (const Family& family : Families()) known += fmt::format(", {}N", family.prefix);
  throw InputError(fmt::format("--problems: expected one of {1}, found '{0}'", name, known));
}

}  // namespace

std::vector<SolverProblemSource> SolverProblemSources(const SolverProblemOptions& options) {
  std::vector<SolverProblemSource> sources;
  for (const std::string& name : options.names) {
    if (name != "bal" && name != "local") {
      sources.push_back(MakeSource(options, name));
      continue;
    }
    for (const std::string& path : options.bal_paths) {
      if (name == "bal") {
        sources.push_back({"bal_" + NameOfBalFile(path), [=] { return MakeBal(options, path); }});
      } else {
        sources.push_back({LocalName(path), [=] { return MakeLocal(options, path); }});
      }
    }
  }
  return sources;
}

Reconstruction LocalCut(const Reconstruction& model, size_t num_images, size_t max_points) {
  std::vector<image_t> image_ids;
  for (const auto& [image_id, image] : model.images) {
    if (image_ids.size() == num_images) break;
    image_ids.push_back(image_id);
  }
  return CutOut(model, image_ids, max_points);
}

Reconstruction CutOut(const Reconstruction& model, std::span<const image_t> image_ids,
                      size_t max_points) {
  Reconstruction cut;
  std::vector<std::pair<image_t, Image>> images;
  for (const image_t image_id : image_ids) {
    const Image& image = model.images.at(image_id);
    images.emplace_back(image_id, image);
    Image& kept = images.back().second;
    kept.points2D.clear();
    kept.lines2D.clear();
    kept.groups2D.clear();
    kept.frame_id = kInvalidId32;
    cut.cameras.Add(image.camera_id, model.cameras.at(image.camera_id));
  }
  const auto find = [&](image_t image_id) {
    size_t i = 0;
    while (i < images.size() && images[i].first != image_id) ++i;
    return i;
  };
  for (const auto& [point_id, point] : model.points3D) {
    if (cut.points3D.size() == max_points) break;
    Point3D kept = point;
    std::erase_if(kept.track,
                  [&](const PointObservation& o) { return find(o.image_id) == images.size(); });
    if (kept.track.size() < 2) continue;
    for (PointObservation& o : kept.track) {
      std::vector<Point2D>& points2D = images[find(o.image_id)].second.points2D;
      points2D.push_back(model.images.at(o.image_id).points2D[o.point2D_idx]);
      o.point2D_idx = static_cast<point2D_t>(points2D.size() - 1);
    }
    cut.points3D.Add(point_id, std::move(kept));
  }
  for (auto& [image_id, image] : images) cut.images.Add(image_id, std::move(image));
  cut.AddTrivialRigsAndFrames();
  return cut;
}

double ObservationsPerImage(bool is_collection, int num_images) {
  if (is_collection) return num_images <= 200 ? 1345.0 : 869.0;
  return num_images <= 500 ? 790.0 : num_images <= 2000 ? 600.0 : 406.0;
}

bool IsBalModel(const Reconstruction& model) {
  return std::all_of(model.cameras.begin(), model.cameras.end(), [](const auto& entry) {
    const Camera& camera = entry.second;
    return camera.model == &SnavelyCameraModel() && camera.params[1] == 0.0 &&
           camera.params[2] == 0.0;
  });
}

}  // namespace holba
