// SPDX-License-Identifier: BSD-3-Clause
// Comparison with ground truth.
#include <fmt/format.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.h"
#include "calls.h"
#include "holba/base/error.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/evaluation/ground_truth.h"
#include "holba/evaluation/pose_auc.h"
#include "module.h"

namespace holba::python {
namespace {

AlignmentBasis BasisOf(const std::string& name) {
  if (name == "auto") return AlignmentBasis::kAuto;
  if (name == "centres") return AlignmentBasis::kCentres;
  if (name == "centres_and_points") return AlignmentBasis::kCentresAndPoints;
  throw InputError(
      fmt::format("alignment: expected auto, centres or centres_and_points, found '{}'", name));
}

AucConvention ConventionOf(const std::string& name) {
  if (name == "step") return AucConvention::kStep;
  if (name == "trapezoid") return AucConvention::kTrapezoid;
  throw InputError(fmt::format("convention: expected step or trapezoid, found '{}'", name));
}

std::vector<Eigen::Vector3d> Rows(const ArrayArg<double, -1, 3>& points) {
  std::vector<Eigen::Vector3d> out;
  for (size_t i = 0; i < points.shape(0); ++i) out.emplace_back(points.data() + 3 * i);
  return out;
}

}  // namespace

void BindEvaluation(nb::module_& m) {
  m.def("_evaluate",
        [](const Reconstruction& model) { return Unlocked([&] { return EvaluateModel(model); }); });
  nb::class_<GroundTruthErrors> errors(m, "GroundTruthErrors",
                                       "Errors of a model after its alignment to the truth.");
  errors.def_prop_ro(
      "values",
      [](const GroundTruthErrors& e) {
        std::map<std::string, double> out;
        for (const auto& [name, value] : e.Named()) out[name] = value;
        return out;
      },
      "By name: rotation_rms_deg, position_median, point_rms, ...; lengths in the truth's units.");
  errors.def_prop_ro("truth_from_model",
                     [](const GroundTruthErrors& e) { return e.alignment.truth_from_model; });
  errors.def("__repr__", [](const GroundTruthErrors& e) {
    std::string text;
    for (const auto& [name, value] : e.Named())
      text += fmt::format("{}{}={:.6g}", text.empty() ? "" : ", ", name, value);
    return "GroundTruthErrors(" + text + ")";
  });
  m.def(
      "compare_to_truth",
      [](const Reconstruction& model, const Reconstruction& truth, const std::string& alignment) {
        const AlignmentBasis basis = BasisOf(alignment);
        return Unlocked([&] { return CompareToTruth(model, truth, basis); });
      },
      nb::arg("model"), nb::arg("truth"), nb::kw_only(), nb::arg("alignment") = "auto",
      "Errors after a similarity. Images are paired by name, features by their ids where these "
      "mean the same in "
      "both. alignment: auto, centres or centres_and_points. None: no image in common.");
  m.def(
      "align",
      [](const Reconstruction& model, const Reconstruction& truth, const std::string& alignment) {
        const AlignmentBasis basis = BasisOf(alignment);
        return Unlocked([&] { return AlignReconstructions(model, truth, basis); });
      },
      nb::arg("model"), nb::arg("truth"), nb::kw_only(), nb::arg("alignment") = "auto",
      "truth_from_model by least squares over images of one name (and points); positions that are "
      "far off are left "
      "out. None: no image in common.");
  m.def(
      "estimate_similarity",
      [](const ArrayArg<double, -1, 3>& from, const ArrayArg<double, -1, 3>& to) {
        return EstimateSimilarity(Rows(from), Rows(to));
      },
      nb::arg("points_from"), nb::arg("points_to"),
      "to_from_from that minimises the squared distances of two sets of points (n, 3) (Umeyama "
      "1991). None: fewer "
      "than 3, on one line, or sets of different sizes.");
  nb::class_<PoseErrors> poses(m, "PoseErrors",
                               "Errors of relative poses of all pairs of true images.");
  poses.def_ro("images", &PoseErrors::images, "Of the truth.");
  poses.def_ro("registered", &PoseErrors::registered, "Of those, how many the model has.");
  poses.def_ro("registered_pairs", &PoseErrors::registered_pairs);
  poses.def_prop_ro(
      "rotation_deg", [](const PoseErrors& e) { return Owned1(e.rotation_deg); },
      "(n,) by pair; infinite: the model lacks an image.");
  poses.def_prop_ro(
      "translation_deg", [](const PoseErrors& e) { return Owned1(e.translation_deg); },
      "(n,) angles between translation directions.");
  poses.def_prop_ro(
      "pair_deg", [](const PoseErrors& e) { return Owned1(e.pair_deg); },
      "(n,) the larger of the two.");
  poses.def(
      "auc",
      [](const PoseErrors& e, const std::vector<double>& thresholds,
         const std::string& convention) {
        const AucConvention c = ConventionOf(convention);
        std::vector<double> auc;
        for (double t : thresholds) {
          if (!(t > 0.0))
            throw InputError(fmt::format("thresholds_deg: expected numbers above 0, found {}", t));
          auc.push_back(100.0 * PoseAuc(e.pair_deg, t, c));
        }
        return auc;
      },
      nb::arg("thresholds_deg") = std::vector<double>{1, 3, 5, 10}, nb::kw_only(),
      nb::arg("convention") = "step",
      nb::sig("def auc(self, thresholds_deg: collections.abc.Sequence[float] = (1, 3, 5, 10), *, "
              "convention: str = 'step') -> list[float]"),
      "Area under the recall curve up to each threshold, %. convention: step (exact) or trapezoid "
      "(as COLMAP's and "
      "hloc's benchmarks).");
  m.def(
      "compare_poses",
      [](const Reconstruction& model, const Reconstruction& truth, double min_baseline, bool fold) {
        return Unlocked([&] {
          return ComparePoses(model, truth,
                              {.min_baseline = min_baseline, .fold_translation = fold});
        });
      },
      nb::arg("model"), nb::arg("truth"), nb::kw_only(), nb::arg("min_baseline") = 1e-3,
      nb::arg("fold_translation") = false,
      "Relative poses of a model against true ones, as `holba evaluate_poses`; images are paired "
      "by name.");
}

}  // namespace holba::python
