// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/image_pairing.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/scene/name_pairing.h"

namespace holba {
namespace {

std::vector<std::string_view> NamesOf(const Reconstruction& model) {
  std::vector<std::string_view> names;
  for (const auto& [image_id, image] : model.images) names.push_back(image.name);
  return names;
}

// How many features of one id have tracks in both models, and how many of these share an
// observation.
struct SharedIds {
  size_t num_seen = 0, num_same = 0;
};

// `idx_of(observation)`: the index of the 2D feature.
template <typename Map, typename IdxOf>
void CountSharedIds(const Map& model, const Map& truth, const ImagePairing& pairing, IdxOf idx_of,
                    SharedIds* ids) {
  for (const auto& [id, feature] : truth) {
    const auto* other = model.Find(id);
    if (other == nullptr) continue;
    bool is_seen = false, is_same = false;
    for (const auto& observation : feature.track) {
      const auto image = pairing.model_id_of_truth.find(observation.image_id);
      if (image == pairing.model_id_of_truth.end()) continue;
      is_seen = !other->track.empty();
      is_same =
          is_same ||
          std::any_of(other->track.begin(), other->track.end(), [&](const auto& element) {
            return element.image_id == image->second && idx_of(element) == idx_of(observation);
          });
    }
    ids->num_seen += is_seen ? 1 : 0;
    ids->num_same += is_same ? 1 : 0;
  }
}

bool FeaturesHaveSameIds(const Reconstruction& model, const Reconstruction& truth,
                         const ImagePairing& pairing) {
  SharedIds ids;
  CountSharedIds(
      model.points3D, truth.points3D, pairing,
      [](const PointObservation& observation) { return observation.point2D_idx; }, &ids);
  CountSharedIds(
      model.lines3D, truth.lines3D, pairing,
      [](const LineObservation& observation) { return observation.line2D_idx; }, &ids);
  if (ids.num_seen > 0) return 2 * ids.num_same > ids.num_seen;
  const auto& pairs = pairing.model_id_of_truth;
  return std::all_of(pairs.begin(), pairs.end(),
                     [](const auto& pair) { return pair.first == pair.second; });
}

}  // namespace

ImagePairing PairImages(const Reconstruction& model, const Reconstruction& truth) {
  const std::vector<std::string_view> true_names = NamesOf(truth), model_names = NamesOf(model);
  const NamePairing names = PairNames(true_names, model_names);
  ImagePairing pairing;
  pairing.num_truth = true_names.size();
  pairing.num_model = model_names.size();
  pairing.num_whole = names.num_whole;
  pairing.num_by_ending = names.num_by_ending;
  pairing.num_ambiguous = names.num_ambiguous;
  pairing.examples = names.examples;
  if (names.unpaired_a) pairing.unpaired_truth = true_names[*names.unpaired_a];
  if (names.unpaired_b) pairing.unpaired_model = model_names[*names.unpaired_b];
  for (size_t i = 0; i < true_names.size(); ++i) {
    if (!names.b_of_a[i]) continue;
    pairing.model_id_of_truth[truth.images.begin()[static_cast<std::ptrdiff_t>(i)].first] =
        model.images.begin()[static_cast<std::ptrdiff_t>(*names.b_of_a[i])].first;
  }
  pairing.features_have_same_ids = FeaturesHaveSameIds(model, truth, pairing);
  return pairing;
}

void ReportPairing(const ImagePairing& pairing, const std::filesystem::path& truth_path) {
  const size_t most = std::min(pairing.num_truth, pairing.num_model);
  if (2 * pairing.NumPairs() < most) {
    throw InputError(
        truth_path,
        fmt::format(
            "only {} of the {} images of the model have a name of the truth{}: the model has "
            "'{}', the truth has '{}'; give both the same names (folders before them, "
            "extensions and case may differ)",
            pairing.NumPairs(), pairing.num_model,
            pairing.num_ambiguous > 0
                ? fmt::format(" ({} fit several equally well)", pairing.num_ambiguous)
                : "",
            pairing.unpaired_model, pairing.unpaired_truth));
  }
  if (pairing.num_by_ending > 0) {
    LogInfo("{}", HowPaired("image", pairing.num_whole, pairing.num_by_ending, pairing.examples));
  }
  if (pairing.num_ambiguous > 0) {
    LogWarning(
        "{} {} several images of the model equally well and {} left out, for example '{}'; give "
        "both models the same names",
        Counted(pairing.num_ambiguous, "true image"), Agree(pairing.num_ambiguous, "fits", "fit"),
        Agree(pairing.num_ambiguous, "is", "are"), pairing.unpaired_truth);
  }
}

}  // namespace holba
