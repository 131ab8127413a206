// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/retrieval.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "holba/base/random.h"
#include "holba/base/threads.h"
#include "holba/frontend/matching/descriptor_matching.h"

namespace holba {
namespace {

using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// `count` of the descriptors, evenly spread, as unit vectors.
Rows Sample(const Descriptors& descriptors, size_t count) {
  const bool are_floats = AreFloats(descriptors);
  const size_t length = are_floats ? descriptors.num_bytes / 4 : descriptors.num_bytes;
  const size_t size = descriptors.size(), kept = std::min(size, count);
  Rows rows(kept, length);
  std::vector<float> values(length);
  for (size_t i = 0; i < kept; ++i) {
    const uint8_t* from = descriptors.data.data() + i * size / kept * descriptors.num_bytes;
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

void Describe(const Rows& rows, const Rows& words, float* global) {
  Eigen::Map<Rows> sums(global, words.rows(), words.cols());
  sums.setZero();
  if (rows.rows() == 0) return;
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

}  // namespace

ImageRetrieval::ImageRetrieval(const RetrievalOptions& options, std::span<const Descriptors> images)
    : num_images_{images.size()} {
  const Descriptors* first = nullptr;
  for (const Descriptors& d : images) {
    if (first == nullptr && d.size() > 0) first = &d;
  }
  if (first == nullptr) return;
  const auto is_usable = [&](const Descriptors& d) {
    return d.size() > 0 && d.type == first->type && d.num_bytes == first->num_bytes;
  };
  const size_t per_image =
      std::max<size_t>(1, options.num_training / std::max<size_t>(1, images.size()));
  std::vector<Rows> samples(images.size());
  ParallelTasks(options.num_threads, images.size(), [&](size_t i) {
    if (is_usable(images[i])) samples[i] = Sample(images[i], per_image);
  });
  Eigen::Index num_rows = 0;
  for (const Rows& rows : samples) num_rows += rows.rows();
  Rows training(num_rows, Sample(*first, 1).cols());
  num_rows = 0;
  for (const Rows& rows : samples) {
    if (rows.rows() == 0) continue;
    training.middleRows(num_rows, rows.rows()) = rows;
    num_rows += rows.rows();
  }
  const Rows words = LearnWords(options, training);
  length_ = static_cast<size_t>(words.size());
  global_.assign(num_images_ * length_, 0.0f);
  ParallelTasks(options.num_threads, images.size(), [&](size_t i) {
    if (!is_usable(images[i])) return;
    Describe(Sample(images[i], options.max_descriptors_per_image), words,
             global_.data() + i * length_);
  });
}

std::vector<uint32_t> ImageRetrieval::Nearest(size_t image, size_t count) const {
  if (length_ == 0) return {};
  const Eigen::Map<const Rows> all(global_.data(), static_cast<Eigen::Index>(num_images_),
                                   static_cast<Eigen::Index>(length_));
  if (all.row(image).isZero(0.0f)) return {};
  const Eigen::VectorXf similarity = all * all.row(image).transpose();
  std::vector<uint32_t> others;
  for (uint32_t i = 0; i < num_images_; ++i) {
    if (i != image && !all.row(i).isZero(0.0f)) others.push_back(i);
  }
  const size_t kept = std::min(count, others.size());
  std::partial_sort(others.begin(), others.begin() + kept, others.end(),
                    [&](uint32_t a, uint32_t b) {
                      return similarity[a] != similarity[b] ? similarity[a] > similarity[b] : a < b;
                    });
  others.resize(kept);
  return others;
}

}  // namespace holba
