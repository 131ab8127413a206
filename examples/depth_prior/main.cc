// SPDX-License-Identifier: BSD-3-Clause
// What a monocular depth prior does for points that are seen under small angles.
//
//   depth_prior SCENE PICTURE.svg
//
// SCENE is made by `holba synthesize`. Its start is adjusted twice by the native solver: points
// alone, and points with the prior of each observation (depth_prior.h), whose depths are the true
// ones with a relative error of 3 % and a scale of its own in each image, as networks have them.
// Prints the error along the line of sight of both, draws both from above, and fails unless the
// prior has made it smaller.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <memory>
#include <vector>

#include "depth_prior.h"
#include "holba/base/random.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/evaluation/alignment.h"
#include "holba/io/model_io.h"
#include "holba/solver/solver.h"

namespace {

using holba::BlockId;
using holba::Reconstruction;

constexpr double kRelativeError = 0.03;

// Depths that a network would give for every observed point of an image.
class MonocularDepths {
 public:
  explicit MonocularDepths(const Reconstruction& truth) : truth_(truth) {}

  double LogDepth(holba::image_t image_id, holba::point3D_t point_id) {
    const auto [scale, is_new] = log_scales_.try_emplace(image_id);
    if (is_new) scale->second = random_.Normal(0.5);
    const double z =
        (truth_.images.at(image_id).cam_from_world * truth_.points3D.at(point_id).xyz).z();
    return std::log(z) - scale->second + random_.Normal(kRelativeError);
  }

 private:
  const Reconstruction& truth_;
  holba::Random random_{5};
  std::map<holba::image_t, double> log_scales_;
};

// One more batch of residuals, and a block for the scale of each image.
void AddDepthPriors(const Reconstruction& model, MonocularDepths* depths,
                    holba::BundleProblem* bundle) {
  using Batch = holba::KernelBatch<holba::example::DepthPriorResidual>;
  auto batch = std::make_unique<Batch>("depth_prior", 1, std::vector<int>{3, 6, 1},
                                       holba::example::DepthPriorResidual{kRelativeError});
  const std::map<holba::frame_t, BlockId> poses(bundle->poses.begin(), bundle->poses.end());
  std::map<holba::image_t, BlockId> scales;
  for (const auto& [point_id, block] : bundle->points) {
    for (const holba::PointObservation& seen : model.points3D.at(point_id).track) {
      const auto [scale, is_new] = scales.try_emplace(seen.image_id);
      if (is_new) {
        const double start = 0.0;
        scale->second = bundle->problem.AddBlock("depth_scale", holba::EuclideanOps(1),
                                                 holba::BlockRole::kGroup, {&start, 1});
      }
      const BlockId pose = poses.at(model.images.at(seen.image_id).frame_id);
      batch->Add(std::array{block, pose, scale->second},
                 {depths->LogDepth(seen.image_id, point_id)});
    }
  }
  bundle->problem.AddBatch(std::move(batch));
}

Reconstruction Adjusted(const Reconstruction& start, MonocularDepths* depths) {
  Reconstruction model = start;
  holba::BundleOptions options;
  options.config = holba::BundleConfig::kPoint;
  options.refine_focal_length = false;
  holba::BundleProblem bundle = holba::BuildProblem(model, options);
  if (depths != nullptr) AddDepthPriors(model, depths, &bundle);
  holba::SolverOptions solver;
  solver.num_threads = 1;
  holba::Solve(solver, &bundle.problem);
  holba::WriteBack(bundle, &model);
  return model;
}

struct Errors {
  std::vector<Eigen::Vector3d> points;  // in the frame of the truth
  double median_along = 0.0;            // the line of sight, over the depth
};

// Against the truth, after the similarity of the camera centres.
Errors ErrorsOf(Reconstruction model, const Reconstruction& truth) {
  const auto truth_from_model =
      AlignReconstructions(model, truth, holba::AlignmentBasis::kCentresAndPoints);
  model.Transform(truth_from_model.value());
  Errors errors;
  std::vector<double> along;
  for (const auto& [id, point] : model.points3D) {
    errors.points.push_back(point.xyz);
    const Eigen::Vector3d X = truth.points3D.at(id).xyz;
    const holba::Image& image = truth.images.at(point.track.front().image_id);
    const double depth = (image.cam_from_world * X).z();
    along.push_back(std::abs((image.cam_from_world * point.xyz).z() - depth) / depth);
  }
  std::nth_element(along.begin(), along.begin() + along.size() / 2, along.end());
  errors.median_along = along[along.size() / 2];
  return errors;
}

// From above, points without the prior (grey), with it (blue), each tied to its true place.
void Draw(const char* path, const Reconstruction& truth, const Errors& without,
          const Errors& with) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300), high = -low;
  for (const auto& [id, point] : truth.points3D) {
    low = low.cwiseMin(point.xyz.head<2>());
    high = high.cwiseMax(point.xyz.head<2>());
  }
  const Eigen::Vector2d margin = 0.1 * (high - low);
  low -= margin, high += margin;
  const double width = 400.0, height = width * (high - low).y() / (high - low).x();
  std::ofstream file(path);
  char text[256];
  std::snprintf(text, sizeof text,
                "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" "
                "font-family=\"sans-serif\" font-size=\"13\">\n",
                2.0 * width + 20.0, height + 24.0);
  file << text << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  const std::array<const Errors*, 2> both{&without, &with};
  const std::array<const char*, 2> colours{"#888888", "#1f6fb4"};
  const std::array<const char*, 2> names{"points alone", "with depth priors"};
  for (size_t k = 0; k < 2; ++k) {
    const double left = static_cast<double>(k) * (width + 20.0);
    const auto place = [&](const Eigen::Vector3d& X) -> Eigen::Vector2d {
      const Eigen::Vector2d unit = (X.head<2>() - low).cwiseQuotient(high - low);
      return {left + width * unit.x(), 24.0 + height * (1.0 - unit.y())};
    };
    std::snprintf(text, sizeof text,
                  "<text x=\"%.0f\" y=\"15\">%s: median error of depth %.2f %%</text>\n"
                  "<g stroke=\"%s\" fill=\"%s\">\n",
                  left + 4.0, names[k], 100.0 * both[k]->median_along, colours[k], colours[k]);
    file << text;
    size_t i = 0;
    for (const auto& [id, point] : truth.points3D) {
      const Eigen::Vector2d a = place(point.xyz), b = place(both[k]->points[i++]);
      if (b.x() < left || b.x() > left + width || b.y() < 24.0 || b.y() > 24.0 + height) continue;
      std::snprintf(text, sizeof text,
                    "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>"
                    "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"1.5\"/>\n",
                    a.x(), a.y(), b.x(), b.y(), a.x(), a.y());
      file << text;
    }
    file << "</g>\n";
  }
  file << "</svg>\n";
}

int Run(const std::filesystem::path& scene, const char* picture) {
  const Reconstruction truth = holba::ReadModel(scene / "truth");
  const Reconstruction start = holba::ReadModel(scene / "perturbed");
  MonocularDepths depths(truth);
  const Errors without = ErrorsOf(Adjusted(start, nullptr), truth);
  const Errors with = ErrorsOf(Adjusted(start, &depths), truth);
  Draw(picture, truth, without, with);
  std::printf("median error of depth: %.3f %% with points alone, %.3f %% with depth priors\n",
              100.0 * without.median_along, 100.0 * with.median_along);
  return with.median_along < without.median_along ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "depth_prior SCENE PICTURE.svg\n");
    return 1;
  }
  try {
    return Run(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
