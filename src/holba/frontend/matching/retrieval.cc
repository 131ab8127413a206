// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/retrieval.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <utility>

#include "holba/base/random.h"
#include "holba/base/threads.h"
#include "holba/frontend/matching/descriptor_matching.h"

namespace holba {
namespace {

using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// The first `count` of the descriptors, as unit vectors.
Rows FirstOf(const Descriptors& descriptors, size_t count) {
  const bool are_floats = AreFloats(descriptors);
  const size_t length = are_floats ? descriptors.num_bytes / 4 : descriptors.num_bytes;
  const size_t kept = std::min(descriptors.size(), count);
  Rows rows(kept, length);
  std::vector<float> values(length);
  for (size_t i = 0; i < kept; ++i) {
    const uint8_t* from = descriptors.data.data() + i * descriptors.num_bytes;
    if (are_floats) {
      std::memcpy(values.data(), from, 4 * length);
    } else {
      std::copy_n(from, length, values.begin());
    }
    const Eigen::Map<const Eigen::RowVectorXf> row(values.data(), static_cast<int>(length));
    const float norm = row.norm();
    rows.row(i) = norm > 0 && std::isfinite(norm) ? Eigen::RowVectorXf(row / norm)
                                                  : Eigen::RowVectorXf::Zero(length);
  }
  return rows;
}

// The nearest word of each row.
std::vector<int> Assign(const Rows& rows, const Rows& words) {
  const Eigen::VectorXf half_squares = 0.5f * words.rowwise().squaredNorm();
  const Rows products = rows * words.transpose();
  std::vector<int> nearest(rows.rows());
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    (products.row(i).transpose() - half_squares).maxCoeff(&nearest[i]);
  return nearest;
}

// k-means (Lloyd), started from rows that are drawn.
Rows LearnWords(const RetrievalOptions& options, const Rows& training) {
  const Eigen::Index num_words = std::min<Eigen::Index>(options.num_words, training.rows());
  Random random(options.seed);
  Rows words(num_words, training.cols());
  for (Eigen::Index k = 0; k < num_words; ++k)
    words.row(k) = training.row(static_cast<Eigen::Index>(random.Index(training.rows())));
  constexpr Eigen::Index kChunk = 2048;
  const size_t num_chunks = (training.rows() + kChunk - 1) / kChunk;
  for (int iteration = 0; iteration < options.num_iterations; ++iteration) {
    std::vector<int> nearest(training.rows());
    ParallelTasks(options.num_threads, num_chunks, [&](size_t chunk) {
      const Eigen::Index begin = static_cast<Eigen::Index>(chunk) * kChunk;
      const Eigen::Index size = std::min(kChunk, training.rows() - begin);
      const std::vector<int> part = Assign(training.middleRows(begin, size), words);
      std::copy(part.begin(), part.end(), nearest.begin() + begin);
    });
    Rows sums = Rows::Zero(num_words, training.cols());
    std::vector<int> counts(num_words, 0);
    for (Eigen::Index i = 0; i < training.rows(); ++i) {
      sums.row(nearest[i]) += training.row(i);
      ++counts[nearest[i]];
    }
    for (Eigen::Index k = 0; k < num_words; ++k) {
      // A word that nothing is near begins anew elsewhere.
      words.row(k) = counts[k] > 0 ? Eigen::RowVectorXf(sums.row(k) / static_cast<float>(counts[k]))
                                   : Eigen::RowVectorXf(training.row(
                                         static_cast<Eigen::Index>(random.Index(training.rows()))));
    }
  }
  return words;
}

// VLAD of unit length; `global` has an entry for each of the words'.
void DescribeImage(const Rows& rows, const Rows& words, float* global) {
  Eigen::Map<Rows> sums(global, words.rows(), words.cols());
  sums.setZero();
  const std::vector<int> nearest = Assign(rows, words);
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    sums.row(nearest[i]) += rows.row(i) - words.row(nearest[i]);
  for (Eigen::Index k = 0; k < words.rows(); ++k) {
    const float norm = sums.row(k).norm();
    if (norm > 0) sums.row(k) /= norm;
  }
  sums = sums.array().sign() * sums.array().abs().sqrt();
  const float norm = sums.norm();
  if (norm > 0) sums /= norm;
}

// One row for each image; zeros: the image has no usable descriptors.
Rows GlobalDescriptors(const RetrievalOptions& options, std::span<const Descriptors> images,
                       const std::vector<uint8_t>& is_usable) {
  const size_t per_image = std::max<size_t>(1, options.num_training / images.size());
  std::vector<Rows> samples(images.size());
  Eigen::Index num_rows = 0, length = 0;
  for (size_t i = 0; i < images.size(); ++i) {
    if (!is_usable[i]) continue;
    samples[i] = FirstOf(images[i], per_image);
    num_rows += samples[i].rows();
    length = samples[i].cols();
  }
  Rows training(num_rows, length);
  num_rows = 0;
  for (const Rows& rows : samples) {
    if (rows.rows() == 0) continue;
    training.middleRows(num_rows, rows.rows()) = rows;
    num_rows += rows.rows();
  }
  const Rows words = LearnWords(options, training);
  Rows global = Rows::Zero(static_cast<Eigen::Index>(images.size()), words.size());
  ParallelTasks(options.num_threads, images.size(), [&](size_t i) {
    if (!is_usable[i]) return;
    DescribeImage(FirstOf(images[i], options.max_descriptors_per_image), words,
                  global.row(static_cast<Eigen::Index>(i)).data());
  });
  return global;
}

// Votes of pairs of images; a pair that was not counted has none.
class Votes {
 public:
  Votes() = default;
  Votes(const RetrievalOptions& options, std::span<const Descriptors> images,
        const std::vector<std::vector<uint32_t>>& candidates)
      : of_image_(images.size()) {
    std::vector<PackedDescriptors> packed(images.size());
    ParallelTasks(options.num_threads, images.size(), [&](size_t i) {
      if (!candidates[i].empty())
        packed[i] = PackedDescriptors(images[i], options.num_voting_descriptors);
    });
    std::vector<std::pair<uint32_t, uint32_t>> pairs;
    for (uint32_t i = 0; i < candidates.size(); ++i) {
      for (uint32_t j : candidates[i]) pairs.emplace_back(std::min(i, j), std::max(i, j));
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    std::vector<float> terms(pairs.size());
    ParallelTasks(options.num_threads, pairs.size(), [&](size_t k) {
      const size_t count =
          MatchDescriptors({}, packed[pairs[k].first], packed[pairs[k].second]).matches.size();
      terms[k] = static_cast<float>(options.vote_weight * std::log1p(static_cast<double>(count)));
    });
    for (size_t k = 0; k < pairs.size(); ++k) {
      of_image_[pairs[k].first].emplace_back(pairs[k].second, terms[k]);
      of_image_[pairs[k].second].emplace_back(pairs[k].first, terms[k]);
    }
  }

  void AddTo(size_t image, Eigen::VectorXf* similarity) const {
    if (of_image_.empty()) return;
    for (const auto& [other, term] : of_image_[image]) (*similarity)[other] += term;
  }

 private:
  std::vector<std::vector<std::pair<uint32_t, float>>> of_image_;
};

// The most similar other images of each, best first, by cosines and votes.
std::vector<std::vector<uint32_t>> NearestOfAll(const Rows& global, const Votes& votes,
                                                const std::vector<uint8_t>& is_usable, size_t count,
                                                int num_threads) {
  const Eigen::Index num_images = global.rows();
  std::vector<std::vector<uint32_t>> nearest(num_images);
  // Products of many rows at a time read the whole matrix once for all of them.
  constexpr Eigen::Index kBlock = 64;
  ParallelTasks(num_threads, (num_images + kBlock - 1) / kBlock, [&](size_t block) {
    const Eigen::Index begin = static_cast<Eigen::Index>(block) * kBlock;
    const Eigen::Index size = std::min(kBlock, num_images - begin);
    const Eigen::MatrixXf cosines = global * global.middleRows(begin, size).transpose();
    for (Eigen::Index k = 0; k < size; ++k) {
      const size_t image = begin + k;
      if (!is_usable[image]) continue;
      Eigen::VectorXf similarity = cosines.col(k);
      votes.AddTo(image, &similarity);
      std::vector<uint32_t>& others = nearest[image];
      for (uint32_t i = 0; i < num_images; ++i) {
        if (i != image && is_usable[i]) others.push_back(i);
      }
      const size_t kept = std::min(count, others.size());
      std::partial_sort(others.begin(), others.begin() + static_cast<ptrdiff_t>(kept), others.end(),
                        [&](uint32_t a, uint32_t b) {
                          return similarity[a] != similarity[b] ? similarity[a] > similarity[b]
                                                                : a < b;
                        });
      others.resize(kept);
      others.shrink_to_fit();
    }
  });
  return nearest;
}

// Each row and the mean of its nearest ones.
Rows Averaged(const Rows& global, const std::vector<std::vector<uint32_t>>& nearest,
              int num_threads) {
  Rows averaged = global;
  ParallelTasks(num_threads, nearest.size(), [&](size_t i) {
    if (nearest[i].empty()) return;
    auto row = averaged.row(static_cast<Eigen::Index>(i));
    for (uint32_t j : nearest[i])
      row += global.row(static_cast<Eigen::Index>(j)) / static_cast<float>(nearest[i].size());
    const float norm = row.norm();
    if (norm > 0) row /= norm;
  });
  return averaged;
}

}  // namespace

std::vector<std::vector<uint32_t>> FindImagesAlike(const RetrievalOptions& options,
                                                   std::span<const Descriptors> images,
                                                   size_t count) {
  const auto first =
      std::find_if(images.begin(), images.end(), [](const auto& d) { return d.size() > 0; });
  if (first == images.end()) return std::vector<std::vector<uint32_t>>(images.size());
  std::vector<uint8_t> is_usable(images.size());
  for (size_t i = 0; i < images.size(); ++i) {
    is_usable[i] = images[i].size() > 0 && images[i].type == first->type &&
                   images[i].num_bytes == first->num_bytes;
  }
  const Rows global = GlobalDescriptors(options, images, is_usable);
  const auto nearest = [&](const Rows& rows, const Votes& votes, size_t number) {
    return NearestOfAll(rows, votes, is_usable, number, options.num_threads);
  };
  const Votes votes(options, images, nearest(global, {}, options.num_voting_images));
  return nearest(
      Averaged(global, nearest(global, votes, options.num_averaged), options.num_threads), votes,
      count);
}

Descriptors StrongestFirst(const Keypoints& keypoints, const Descriptors& descriptors,
                           size_t count) {
  const size_t size = descriptors.size(), kept = std::min(size, count);
  std::vector<size_t> order(size);
  std::iota(order.begin(), order.end(), size_t{0});
  if (keypoints.num_cols >= 4 && keypoints.size() == size) {
    // Four columns: the scale itself; six: a shape, whose determinant is the scale's square.
    std::vector<float> scale(size);
    for (size_t i = 0; i < size; ++i) {
      const float* row = keypoints.data.data() + i * keypoints.num_cols;
      scale[i] =
          keypoints.num_cols < 6 ? row[2] * row[2] : std::abs(row[2] * row[5] - row[3] * row[4]);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return scale[a] > scale[b]; });
  } else {
    for (size_t k = 0; k < kept; ++k) order[k] = k * size / kept;
  }
  Descriptors strongest;
  strongest.type = descriptors.type;
  strongest.num_bytes = descriptors.num_bytes;
  strongest.data.reserve(kept * descriptors.num_bytes);
  for (size_t k = 0; k < kept; ++k) {
    const auto from =
        descriptors.data.begin() + static_cast<ptrdiff_t>(order[k] * descriptors.num_bytes);
    strongest.data.insert(strongest.data.end(), from, from + descriptors.num_bytes);
  }
  return strongest;
}

}  // namespace holba
