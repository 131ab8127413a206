// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/image_pairs.h"

#include <algorithm>
#include <cstdint>
#include <set>
#include <utility>

namespace holba {
namespace {

// Positions of images in the model, the image with the smaller id first.
using PositionPair = std::pair<uint32_t, uint32_t>;

std::set<PositionPair> ChoosePairs(const ImagePairOptions& options,
                                   const Covisibility& covisibility,
                                   const std::vector<image_t>& image_ids) {
  std::set<PositionPair> chosen;
  for (uint32_t i = 0; i < covisibility.num_images(); ++i) {
    const auto neighbours = covisibility.NeighboursOf(i);
    std::vector<Covisibility::Neighbour> partners(neighbours.begin(), neighbours.end());
    std::erase_if(partners, [&](const auto& partner) {
      return partner.num_sightings < static_cast<uint32_t>(options.min_shared_points);
    });
    std::sort(partners.begin(), partners.end(), [&](const auto& a, const auto& b) {
      return a.num_sightings != b.num_sightings ? a.num_sightings > b.num_sightings
                                                : image_ids[a.image_idx] < image_ids[b.image_idx];
    });
    const size_t count =
        std::min(partners.size(), static_cast<size_t>(options.max_pairs_per_image));
    for (size_t k = 0; k < count; ++k) {
      const uint32_t j = partners[k].image_idx;
      chosen.insert(image_ids[i] < image_ids[j] ? PositionPair(i, j) : PositionPair(j, i));
    }
  }
  return chosen;
}

}  // namespace

void ImagePairOptions::Describe(OptionTable* table) const {
  table->Section("LineMatching");
  table->Field("max_pairs_per_image", &max_pairs_per_image, AtLeast(1),
               "Images whose segments are matched with those of an image: those that share most "
               "points with it.");
  table->Field("min_shared_points", &min_shared_points, AtLeast(0),
               "Points that such images share at least.");
}

std::vector<SharedPoint> PixelsOf(const Image& image1, const Image& image2,
                                  std::span<const SharedSighting> shared) {
  std::vector<SharedPoint> pixels;
  pixels.reserve(shared.size());
  for (const SharedSighting& s : shared) {
    pixels.emplace_back(image1.points2D[s.point2D_idx1].xy, image2.points2D[s.point2D_idx2].xy);
  }
  return pixels;
}

std::map<ImagePair, std::vector<SharedPoint>> PairsWithSharedPoints(const ImagePairOptions& options,
                                                                    const Reconstruction& model) {
  const Covisibility covisibility(model);
  std::vector<image_t> image_ids;
  for (const auto& [image_id, image] : model.images) image_ids.push_back(image_id);
  const std::set<PositionPair> chosen = ChoosePairs(options, covisibility, image_ids);

  std::map<ImagePair, std::vector<SharedPoint>> pairs;
  for (uint32_t i = 0; i < covisibility.num_images(); ++i) {
    const auto neighbours = covisibility.NeighboursOf(i);
    const Covisibility::Shared shared = covisibility.SharedWithNeighbours(i);
    for (size_t k = 0; k < neighbours.size(); ++k) {
      const uint32_t j = neighbours[k].image_idx;
      if (!chosen.contains({i, j})) continue;
      pairs[{image_ids[i], image_ids[j]}] =
          PixelsOf(model.images.at(image_ids[i]), model.images.at(image_ids[j]), shared[k]);
    }
  }
  return pairs;
}

}  // namespace holba
