// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/next_image.h"

#include <algorithm>
#include <tuple>

namespace holba {
namespace {

int NumTrials(const MapperState& state, image_t image_id) {
  const auto found = state.num_registration_trials.find(image_id);
  return found != state.num_registration_trials.end() ? found->second : 0;
}

struct Candidate {
  bool was_tried;
  size_t score;
  image_t image_id;
};

std::vector<image_t> Ranked(std::vector<Candidate> candidates) {
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    if (a.was_tried != b.was_tried) return b.was_tried;
    return a.score != b.score ? a.score > b.score : a.image_id < b.image_id;
  });
  std::vector<image_t> images;
  for (const Candidate& candidate : candidates) images.push_back(candidate.image_id);
  return images;
}

}  // namespace

std::vector<image_t> RankNextImages(const NextImageOptions& options, MapperState* state) {
  std::vector<Candidate> candidates;
  for (const auto& [id, image] : state->model().unregistered_images) {
    if (!state->graph().Contains(id)) continue;
    const int trials = NumTrials(*state, id);
    if (trials >= options.max_trials) continue;
    const ImageVisibility& visibility = state->VisibilityOf(id);
    if (visibility.num_points + visibility.num_lines < static_cast<size_t>(options.min_num_visible))
      continue;
    candidates.push_back({trials > 0, visibility.score, id});
  }
  return Ranked(std::move(candidates));
}

std::vector<image_t> RankByMatches(const NextImageOptions& options, size_t min_num_matches,
                                   const MapperState& state) {
  std::vector<Candidate> candidates;
  for (const auto& [id, image] : state.model().unregistered_images) {
    if (!state.graph().Contains(id)) continue;
    const int trials = NumTrials(state, id);
    if (trials >= options.max_trials) continue;
    size_t num_matches = 0;
    for (const MatchedImage& matched : state.graph().MatchedImages(id)) {
      if (state.model().images.contains(matched.image_id)) num_matches += matched.num_matches;
    }
    if (num_matches >= min_num_matches) candidates.push_back({trials > 0, num_matches, id});
  }
  return Ranked(std::move(candidates));
}

}  // namespace holba
