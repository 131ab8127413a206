// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/pose_auc.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "holba/base/check.h"
#include "holba/evaluation/statistics.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

struct PosePair {
  std::string_view name;
  const Rigid3d* truth;
  const Rigid3d* model;  // null: not registered
};

// True images in order of their names.
std::vector<PosePair> PairPoses(const Reconstruction& model, const Reconstruction& truth,
                                const ImagePairing& pairing) {
  std::vector<PosePair> pairs;
  for (const auto& [id, image] : truth.images) {
    const auto found = pairing.model_id_of_truth.find(id);
    const bool is_registered = found != pairing.model_id_of_truth.end();
    pairs.push_back({image.name, &image.cam_from_world,
                     is_registered ? &model.images.at(found->second).cam_from_world : nullptr});
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const PosePair& a, const PosePair& b) { return a.name < b.name; });
  return pairs;
}

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  if (!(a.squaredNorm() > 0) || !(b.squaredNorm() > 0)) return 180.0;
  return kDegPerRad * std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

PoseErrors ComparePoses(const Reconstruction& model, const Reconstruction& truth,
                        const PoseErrorOptions& options) {
  PoseErrors errors;
  errors.pairing = PairImages(model, truth);
  const std::vector<PosePair> images = PairPoses(model, truth, errors.pairing);
  errors.images = images.size();
  for (const PosePair& image : images) errors.registered += image.model != nullptr;
  if (images.size() < 2) return errors;

  std::vector<double> baselines;
  baselines.reserve(images.size() * (images.size() - 1) / 2);
  for (size_t i = 0; i < images.size(); ++i) {
    const Eigen::Vector3d centre = images[i].truth->OriginInA();
    for (size_t j = i + 1; j < images.size(); ++j) {
      baselines.push_back((images[j].truth->OriginInA() - centre).norm());
    }
  }
  const double floor = options.min_baseline * Summarise(baselines)->median;

  size_t pair = 0;
  errors.rotation_deg.assign(baselines.size(), std::numeric_limits<double>::infinity());
  errors.translation_deg = errors.pair_deg = errors.rotation_deg;
  for (size_t i = 0; i < images.size(); ++i) {
    for (size_t j = i + 1; j < images.size(); ++j, ++pair) {
      if (images[i].model == nullptr || images[j].model == nullptr) continue;
      const Rigid3d true_j_from_i = *images[j].truth * images[i].truth->Inverse();
      const Rigid3d j_from_i = *images[j].model * images[i].model->Inverse();
      const double rotation =
          kDegPerRad * LogRotation(j_from_i.rotation * true_j_from_i.rotation.conjugate()).norm();
      double translation = 0.0;
      if (baselines[pair] > floor) {
        translation = AngleDeg(j_from_i.translation, true_j_from_i.translation);
        if (options.fold_translation) translation = std::min(translation, 180.0 - translation);
      }
      errors.rotation_deg[pair] = rotation;
      errors.translation_deg[pair] = translation;
      errors.pair_deg[pair] = std::max(rotation, translation);
      ++errors.registered_pairs;
    }
  }
  return errors;
}

double PoseAuc(std::span<const double> errors_deg, double threshold_deg, AucConvention convention) {
  HOLBA_CHECK(threshold_deg > 0);
  if (errors_deg.empty()) return 0.0;
  const double n = static_cast<double>(errors_deg.size());
  if (convention == AucConvention::kStep) {
    double sum = 0.0;
    for (const double e : errors_deg) {
      if (e < threshold_deg) sum += 1.0 - e / threshold_deg;
    }
    return sum / n;
  }
  // The curve passes (0, 0), (e_1, 1/n), ..., (e_k, k/n) and stays level from the last error below
  // the threshold on.
  std::vector<double> below;
  for (const double e : errors_deg) {
    if (e < threshold_deg) below.push_back(e);
  }
  std::sort(below.begin(), below.end());
  double area = 0.0, last_error = 0.0, last_recall = 0.0;
  for (size_t k = 0; k < below.size(); ++k) {
    const double recall = static_cast<double>(k + 1) / n;
    area += 0.5 * (below[k] - last_error) * (recall + last_recall);
    last_error = below[k];
    last_recall = recall;
  }
  area += (threshold_deg - last_error) * last_recall;
  return area / threshold_deg;
}

}  // namespace holba
