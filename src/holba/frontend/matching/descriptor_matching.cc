// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/descriptor_matching.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "holba/base/check.h"
#include "holba/frontend/matching/descriptor_kernels.h"

namespace holba {
namespace {

// Of bytes: descriptors have the length 512.
constexpr double kSquaredByteNorm = 512.0 * 512.0;

size_t RoundUp(size_t n, size_t unit) { return (n + unit - 1) / unit * unit; }

}  // namespace

void DescriptorMatchOptions::Describe(OptionTable* table) const {
  table->Section("SiftMatching");
  table->Field("max_ratio", &max_ratio, Between(0, 1),
               "Largest distance of the nearest descriptor over that of the second nearest.");
  table->Field("max_distance", &max_distance, Between(0, 3.1416),
               "Largest distance of descriptors, as the angle between them in radians.");
  table->Field("cross_check", &cross_check, "Whether the two must be each other's nearest.");
  table->Section("AlikedMatching");
  table->Field("min_cossim", &min_cossim, Between(-1, 1),
               "Least cosine of the angle between descriptors.");
}

PackedDescriptors::PackedDescriptors(const Descriptors& descriptors, size_t max_num) {
  are_floats_ = AreFloats(descriptors);
  size_ = std::min(descriptors.size(), max_num);
  const int entries = are_floats_ ? descriptors.num_bytes / 4 : descriptors.num_bytes;
  length_ = static_cast<int>(RoundUp(entries, 4));
  if (are_floats_) {
    PackFloats(descriptors);
  } else {
    PackBytes(descriptors);
  }
}

void PackedDescriptors::PackBytes(const Descriptors& descriptors) {
  const size_t length = length_, entries = descriptors.num_bytes;
  // Filled up with zeros: minus 128 in rows, whose products with columns are 0 all the same.
  rows_.assign(RoundUp(size_, kRowPadding) * length, -128);
  const size_t num_columns = RoundUp(size_, kDescriptorBlock);
  columns_.assign(num_columns * length, 0);
  column_sums_.assign(num_columns, 0);
  for (size_t i = 0; i < size_; ++i) {
    const uint8_t* from = descriptors.data.data() + i * entries;
    uint8_t* block = columns_.data() + i / kDescriptorBlock * kDescriptorBlock * length;
    int32_t sum = 0;
    for (size_t k = 0; k < entries; ++k) {
      rows_[i * length + k] = static_cast<int8_t>(static_cast<int>(from[k]) - 128);
      block[(k / 4 * kDescriptorBlock + i % kDescriptorBlock) * 4 + k % 4] = from[k];
      sum += from[k];
    }
    column_sums_[i] = 128 * sum;
  }
}

void PackedDescriptors::PackFloats(const Descriptors& descriptors) {
  const size_t length = length_, entries = descriptors.num_bytes / 4;
  float_rows_.assign(RoundUp(size_, kRowPadding) * length, 0.0f);
  float_columns_.assign(RoundUp(size_, kDescriptorBlock) * length, 0.0f);
  std::vector<float> values(entries);
  for (size_t i = 0; i < size_; ++i) {
    std::memcpy(values.data(), descriptors.data.data() + i * descriptors.num_bytes, 4 * entries);
    double squared = 0.0;
    for (float v : values) squared += static_cast<double>(v) * v;
    const double inverse = squared > 0.0 && std::isfinite(squared) ? 1.0 / std::sqrt(squared) : 0.0;
    float* block = float_columns_.data() + i / kDescriptorBlock * kDescriptorBlock * length;
    for (size_t k = 0; k < entries; ++k) {
      const float v = inverse == 0.0 ? 0.0f : static_cast<float>(values[k] * inverse);
      float_rows_[i * length + k] = v;
      block[k * kDescriptorBlock + i % kDescriptorBlock] = v;
    }
  }
}

size_t PackedDescriptors::NumBytes() const {
  return rows_.size() + columns_.size() + 4 * column_sums_.size() + 4 * float_rows_.size() +
         4 * float_columns_.size();
}

double PackedDescriptors::Cosine(size_t i, const PackedDescriptors& other, size_t j) const {
  HOLBA_CHECK(are_floats_ == other.are_floats_ && length_ == other.length_);
  const size_t length = length_;
  if (are_floats_) {
    const float *a = float_rows_.data() + i * length, *b = other.float_rows_.data() + j * length;
    float sum = 0.0f;
    for (size_t k = 0; k < length; ++k) sum += a[k] * b[k];
    return sum;
  }
  const int8_t *a = rows_.data() + i * length, *b = other.rows_.data() + j * length;
  int32_t sum = 0;
  for (size_t k = 0; k < length; ++k) sum += (a[k] + 128) * (b[k] + 128);
  return sum / kSquaredByteNorm;
}

// The two most similar descriptors of each, in both directions.
class DescriptorProduct {
 public:
  template <typename Value>
  struct Nearest {
    std::vector<Value> best, second;
    std::vector<int32_t> idx;

    explicit Nearest(size_t size) : best(size), second(size), idx(size, -1) {}
    TwoLargest<Value> At(size_t i) { return {best.data() + i, second.data() + i, idx.data() + i}; }
  };

  DescriptorProduct(const PackedDescriptors& d1, const PackedDescriptors& d2) {
    if (d1.are_floats_) {
      Run<float, FloatProduct>(d1, d2, d1.float_rows_.data(), d2.float_columns_.data(), 1.0);
    } else {
      Run<int32_t, ByteProduct>(d1, d2, d1.rows_.data(), d2.columns_.data(),
                                1.0 / kSquaredByteNorm);
    }
  }

  std::vector<FoundNeighbour> of_first, of_second;

 private:
  template <typename Value, typename Product, typename Row, typename Column>
  void Run(const PackedDescriptors& d1, const PackedDescriptors& d2, const Row* rows,
           const Column* columns, double unit) {
    const size_t num_rows = RoundUp(d1.size_, kRowPadding);
    const size_t num_columns = RoundUp(d2.size_, kDescriptorBlock);
    Nearest<Value> by_row(num_rows * kLanesOfState), by_column(num_columns);
    for (size_t first = 0; first < num_columns; first += kDescriptorBlock) {
      const Product product{.rows = rows,
                            .columns = columns + first * d1.length_,
                            .column_sums = d2.column_sums_.data() + (d1.are_floats_ ? 0 : first),
                            .num_rows = num_rows,
                            .length = d1.length_,
                            .first_column = static_cast<int32_t>(first),
                            .of_rows = by_row.At(0),
                            .of_columns = by_column.At(first)};
      Multiply(product);
    }

    const int lanes = HOLBA_SIMD_CHOOSE(StateLanes)();
    of_first.resize(d1.size_);
    for (size_t i = 0; i < d1.size_; ++i)
      of_first[i] = Reduce(by_row, i * kLanesOfState, lanes, d2.size_, unit);
    of_second.resize(d2.size_);
    for (size_t j = 0; j < d2.size_; ++j) {
      of_second[j] = {by_column.best[j] * unit, by_column.second[j] * unit, by_column.idx[j]};
    }
  }

  static void Multiply(const ByteProduct& product) { HOLBA_SIMD_CHOOSE(MultiplyBytes)(product); }
  static void Multiply(const FloatProduct& product) { HOLBA_SIMD_CHOOSE(MultiplyFloats)(product); }

  // The two largest of the lanes' two largest. What fills up has no positive product, so is never
  // among them.
  template <typename Value>
  static FoundNeighbour Reduce(const Nearest<Value>& state, size_t at, int lanes, size_t size,
                               double unit) {
    Value best = 0, second = 0;
    int64_t idx = -1;
    for (int lane = 0; lane < lanes; ++lane) {
      const Value x = state.best[at + lane];
      if (state.idx[at + lane] < 0) continue;
      const int64_t here = int64_t{state.idx[at + lane]} * lanes + lane;
      if (x > best || (x == best && here < idx)) {
        second = std::max(second, best);
        best = x;
        idx = here;
      } else {
        second = std::max(second, x);
      }
      second = std::max(second, state.second[at + lane]);
    }
    HOLBA_CHECK(idx < static_cast<int64_t>(size));
    return {best * unit, second * unit, static_cast<int32_t>(idx)};
  }
};

DescriptorMatches SelectMatches(const DescriptorMatchOptions& options, bool are_floats,
                                const std::vector<FoundNeighbour>& of_first,
                                const std::vector<FoundNeighbour>& of_second) {
  DescriptorMatches result;
  const double max_distance = are_floats ? std::acos(options.min_cossim) : options.max_distance;
  const auto angle = [](double cosine) { return std::acos(std::clamp(cosine, -1.0, 1.0)); };
  // Over the second nearest; empty: too far or not clearly the nearest.
  const auto ratio_of = [&](const FoundNeighbour& found) -> std::optional<double> {
    if (found.idx < 0) return std::nullopt;
    const double distance = angle(found.cosine), second = angle(found.second_cosine);
    if (distance > max_distance || distance >= options.max_ratio * second) return std::nullopt;
    return distance / second;
  };

  struct Scored {
    double ratio;
    std::array<point2D_t, 2> match;
  };
  std::vector<Scored> scored;
  for (size_t i = 0; i < of_first.size(); ++i) {
    const auto& found = of_first[i];
    result.num_candidates += found.idx >= 0;
    const auto ratio = ratio_of(found);
    if (!ratio) continue;
    const auto& back = of_second[found.idx];
    if (options.cross_check && (back.idx != static_cast<int32_t>(i) || !ratio_of(back))) continue;
    scored.push_back({*ratio, {static_cast<point2D_t>(i), static_cast<point2D_t>(found.idx)}});
  }
  std::sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) {
    return a.ratio != b.ratio ? a.ratio < b.ratio : a.match < b.match;
  });
  for (const Scored& s : scored) result.matches.push_back(s.match);
  return result;
}

Neighbours FindNeighbours(const PackedDescriptors& descriptors1,
                          const PackedDescriptors& descriptors2) {
  if (descriptors1.size() == 0 || descriptors2.size() == 0 ||
      descriptors1.are_floats() != descriptors2.are_floats() ||
      descriptors1.length() != descriptors2.length()) {
    return {std::vector<FoundNeighbour>(descriptors1.size()),
            std::vector<FoundNeighbour>(descriptors2.size())};
  }
  DescriptorProduct product(descriptors1, descriptors2);
  return {std::move(product.of_first), std::move(product.of_second)};
}

DescriptorMatches MatchDescriptors(const DescriptorMatchOptions& options,
                                   const PackedDescriptors& descriptors1,
                                   const PackedDescriptors& descriptors2) {
  const Neighbours found = FindNeighbours(descriptors1, descriptors2);
  return SelectMatches(options, descriptors1.are_floats(), found.of_first, found.of_second);
}

}  // namespace holba
