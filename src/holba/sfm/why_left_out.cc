// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/why_left_out.h"

#include <fmt/format.h>

#include "holba/base/words.h"

namespace holba {
namespace {

std::string Reason(const MapperOptions& options, const MapperState& state, image_t image_id) {
  const Reconstruction& model = state.model();
  const CorrespondenceGraph& graph = state.graph();
  const Image& image = model.unregistered_images.at(image_id);
  if (image.points2D.empty() && image.lines2D.empty()) return "no key points were found in it";
  if (!graph.Contains(image_id) || graph.MatchedImages(image_id).empty()) {
    return fmt::format("none of its {} has a verified match with another image",
                       Counted(image.points2D.size(), "key point"));
  }
  size_t num_matches = 0;
  for (const MatchedImage& matched : graph.MatchedImages(image_id)) {
    if (model.images.contains(matched.image_id)) num_matches += matched.num_matches;
  }
  if (model.images.empty()) {
    return fmt::format("no pair with one of the {} that it has matches with could begin a model",
                       Counted(graph.MatchedImages(image_id).size(), "image"));
  }
  if (num_matches == 0) return "it has matches with images only that are not in the model either";
  if (state.contradicted.contains(image_id)) {
    return fmt::format(
        "{} with images of the model, but none with others that should show the same",
        Counted(num_matches, "match"));
  }
  const auto trials = state.num_registration_trials.find(image_id);
  if (trials != state.num_registration_trials.end()) {
    const auto failure = state.registration_failures.find(image_id);
    return fmt::format("{} with images of the model, but {} ({})", Counted(num_matches, "match"),
                       failure != state.registration_failures.end() && !failure->second.empty()
                           ? failure->second
                           : "the adjustment took its pose back",
                       Counted(static_cast<size_t>(trials->second), "trial"));
  }
  return fmt::format(
      "{} with images of the model; too few of them with its points and lines, of "
      "which {} are wanted",
      Counted(num_matches, "match"), options.next.min_num_visible);
}

}  // namespace

std::map<image_t, std::string> WhyLeftOut(const MapperOptions& options, const MapperState& state) {
  std::map<image_t, std::string> reasons;
  for (const auto& [id, image] : state.model().unregistered_images)
    reasons[id] = Reason(options, state, id);
  return reasons;
}

}  // namespace holba
