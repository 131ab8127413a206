// SPDX-License-Identifier: BSD-3-Clause
// A tile of kRows by kVectors registers of sums is kept while the entries of the descriptors are
// gone through; then its numbers enter the states of their rows and columns.
#include "holba/frontend/matching/descriptor_kernels.h"
#include "holba/simd/pack.h"

namespace holba::HOLBA_SIMD_TARGET {
namespace {

#define HOLBA_UNROLL _Pragma("GCC unroll 32")

#if defined(HOLBA_SIMD_SCALAR)
constexpr int kNumLanes = 1;
template <typename T>
struct VectorOf {
  using Type = T;
  using Unaligned = T;
};
#else
constexpr int kNumLanes = HOLBA_SIMD_BYTES / 4;
template <typename T>
struct VectorOf {
  using Type __attribute__((vector_size(HOLBA_SIMD_BYTES))) = T;
  using Unaligned __attribute__((vector_size(HOLBA_SIMD_BYTES), aligned(1), may_alias)) = T;
};
#endif
template <typename T>
using Vector = typename VectorOf<T>::Type;
using Ints = Vector<int32_t>;

template <typename T>
HOLBA_SIMD_INLINE Vector<T> LoadVector(const void* p) {
  return *static_cast<const typename VectorOf<T>::Unaligned*>(p);
}
template <typename T>
HOLBA_SIMD_INLINE void StoreVector(Vector<T> x, T* p) {
  *reinterpret_cast<typename VectorOf<T>::Unaligned*>(p) = x;
}
template <typename T>
HOLBA_SIMD_INLINE Vector<T> Splat(T x) {
  return x - Vector<T>{};
}

HOLBA_SIMD_INLINE int32_t LoadInt(const void* p) {
  int32_t x;
  __builtin_memcpy(&x, p, 4);
  return x;
}

// Products of four signed bytes, the same in all lanes, with four bytes of each lane.
struct BytesByPairs {
  using Row = int8_t;
  using Column = uint8_t;
  using Value = int32_t;
  static constexpr int kStep = 4;  // entries at once
#if defined(HOLBA_SIMD_SCALAR)
  struct RowEntries {
    int8_t x[4];
  };
  static HOLBA_SIMD_INLINE RowEntries LoadRow(const int8_t* p) { return {p[0], p[1], p[2], p[3]}; }
  using ColumnEntries = const uint8_t*;
  static HOLBA_SIMD_INLINE ColumnEntries LoadColumn(const uint8_t* p) { return p; }
  static HOLBA_SIMD_INLINE Ints Add(Ints sum, ColumnEntries c, const RowEntries& r) {
    for (int k = 0; k < 4; ++k) sum += r.x[k] * c[k];
    return sum;
  }
#else
  // Even and odd bytes as 16-bit numbers, multiplied and added in pairs.
  struct RowEntries {
    Ints even, odd;
  };
  static HOLBA_SIMD_INLINE RowEntries LoadRow(const int8_t* p) {
    const auto pair = [](int8_t a, int8_t b) {
      return static_cast<int32_t>(
          static_cast<uint16_t>(static_cast<int16_t>(a)) |
          (static_cast<uint32_t>(static_cast<uint16_t>(static_cast<int16_t>(b))) << 16));
    };
    return {Splat(pair(p[0], p[2])), Splat(pair(p[1], p[3]))};
  }
  struct ColumnEntries {
    Ints even, odd;
  };
  static HOLBA_SIMD_INLINE ColumnEntries LoadColumn(const uint8_t* p) {
    const Ints bytes = LoadVector<int32_t>(p);
    return {bytes & 0x00ff00ff, (bytes >> 8) & 0x00ff00ff};
  }
  static HOLBA_SIMD_INLINE Ints MultiplyPairs(Ints a, Ints b) {
#if defined(__AVX512F__)
    // 512-bit pairs need AVX-512 BW, which the target does not promise.
    const __m512i x = reinterpret_cast<__m512i>(a), y = reinterpret_cast<__m512i>(b);
    const __m256i low = _mm256_madd_epi16(_mm512_castsi512_si256(x), _mm512_castsi512_si256(y));
    const __m256i high = _mm256_madd_epi16(_mm512_maskz_extracti64x4_epi64(0xf, x, 1),
                                           _mm512_maskz_extracti64x4_epi64(0xf, y, 1));
    return reinterpret_cast<Ints>(_mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1));
#elif defined(__AVX2__)
    return reinterpret_cast<Ints>(
        _mm256_madd_epi16(reinterpret_cast<__m256i>(a), reinterpret_cast<__m256i>(b)));
#elif defined(__SSE2__)
    return reinterpret_cast<Ints>(
        _mm_madd_epi16(reinterpret_cast<__m128i>(a), reinterpret_cast<__m128i>(b)));
#else
    return ((a << 16) >> 16) * ((b << 16) >> 16) + (a >> 16) * (b >> 16);
#endif
  }
  static HOLBA_SIMD_INLINE Ints Add(Ints sum, const ColumnEntries& c, const RowEntries& r) {
    return sum + MultiplyPairs(c.even, r.even) + MultiplyPairs(c.odd, r.odd);
  }
#endif
};

#if defined(__AVX512F__)
// The same by the instruction for it (AVX-512 VNNI), as text because the target does not promise
// it: the caller has asked the processor.
struct BytesByVnni {
  using Row = int8_t;
  using Column = uint8_t;
  using Value = int32_t;
  static constexpr int kStep = 4;
  using RowEntries = Ints;
  static HOLBA_SIMD_INLINE RowEntries LoadRow(const int8_t* p) { return Splat(LoadInt(p)); }
  using ColumnEntries = Ints;
  static HOLBA_SIMD_INLINE ColumnEntries LoadColumn(const uint8_t* p) {
    return LoadVector<int32_t>(p);
  }
  static HOLBA_SIMD_INLINE Ints Add(Ints sum, ColumnEntries c, RowEntries r) {
    asm("vpdpbusd %2, %1, %0" : "+v"(sum) : "v"(c), "v"(r));
    return sum;
  }
};
#endif

struct Floats {
  using Row = float;
  using Column = float;
  using Value = float;
  static constexpr int kStep = 1;
  using RowEntries = Vector<float>;
  static HOLBA_SIMD_INLINE RowEntries LoadRow(const float* p) { return Splat(*p); }
  using ColumnEntries = Vector<float>;
  static HOLBA_SIMD_INLINE ColumnEntries LoadColumn(const float* p) { return LoadVector<float>(p); }
  static HOLBA_SIMD_INLINE Vector<float> Add(Vector<float> sum, ColumnEntries c, RowEntries r) {
    return sum + c * r;
  }
};

// `x` enters the two largest of each lane.
template <typename Value>
HOLBA_SIMD_INLINE void Enter(Vector<Value> x, Ints idx, Vector<Value>* best, Vector<Value>* second,
                             Ints* best_idx) {
  const Vector<Value> smaller = x < *best ? x : *best;
  *second = smaller > *second ? smaller : *second;
  *best_idx = x > *best ? idx : *best_idx;
  *best = x > *best ? x : *best;
}

template <typename Product, int kRows, int kVectors, typename Arguments>
void MultiplyBlock(const Arguments& p) {
  using Value = typename Product::Value;
  using V = Vector<Value>;
  constexpr int kTileColumns = kVectors * kNumLanes;
  static_assert(kDescriptorBlock % kTileColumns == 0 && kRowPadding % kRows == 0);
  const int num_steps = p.length / Product::kStep;
  for (int tile = 0; tile < kDescriptorBlock; tile += kTileColumns) {
    for (size_t row = 0; row < p.num_rows; row += kRows) {
      V sums[kRows][kVectors];
      HOLBA_UNROLL for (int v = 0; v < kVectors; ++v) {
        V start{};
        if constexpr (sizeof(typename Product::Row) == 1) {
          start = LoadVector<int32_t>(p.column_sums + tile + v * kNumLanes);
        }
        HOLBA_UNROLL for (int r = 0; r < kRows; ++r) sums[r][v] = start;
      }
      const typename Product::Row* rows = p.rows + row * p.length;
      const typename Product::Column* columns = p.columns + tile * Product::kStep;
      for (int step = 0; step < num_steps; ++step) {
        typename Product::ColumnEntries c[kVectors];
        HOLBA_UNROLL for (int v = 0; v < kVectors; ++v) {
          c[v] = Product::LoadColumn(columns + v * kNumLanes * Product::kStep);
        }
        HOLBA_UNROLL for (int r = 0; r < kRows; ++r) {
          const auto entries = Product::LoadRow(rows + r * p.length);
          HOLBA_UNROLL for (int v = 0; v < kVectors; ++v) {
            sums[r][v] = Product::Add(sums[r][v], c[v], entries);
          }
        }
        rows += Product::kStep;
        columns += kDescriptorBlock * Product::kStep;
      }

      HOLBA_UNROLL for (int r = 0; r < kRows; ++r) {
        const size_t at = (row + r) * kLanesOfState;
        V best = LoadVector<Value>(p.of_rows.best + at);
        V second = LoadVector<Value>(p.of_rows.second + at);
        Ints idx = LoadVector<int32_t>(p.of_rows.idx + at);
        HOLBA_UNROLL for (int v = 0; v < kVectors; ++v) {
          const Ints here = Splat<int32_t>((p.first_column + tile) / kNumLanes + v);
          Enter<Value>(sums[r][v], here, &best, &second, &idx);
        }
        StoreVector<Value>(best, p.of_rows.best + at);
        StoreVector<Value>(second, p.of_rows.second + at);
        StoreVector<int32_t>(idx, p.of_rows.idx + at);
      }
      HOLBA_UNROLL for (int v = 0; v < kVectors; ++v) {
        const int at = tile + v * kNumLanes;
        V best = LoadVector<Value>(p.of_columns.best + at);
        V second = LoadVector<Value>(p.of_columns.second + at);
        Ints idx = LoadVector<int32_t>(p.of_columns.idx + at);
        HOLBA_UNROLL for (int r = 0; r < kRows; ++r) {
          Enter<Value>(sums[r][v], Splat<int32_t>(static_cast<int32_t>(row) + r), &best, &second,
                       &idx);
        }
        StoreVector<Value>(best, p.of_columns.best + at);
        StoreVector<Value>(second, p.of_columns.second + at);
        StoreVector<int32_t>(idx, p.of_columns.idx + at);
      }
    }
  }
}

}  // namespace

void MultiplyBytes(const ByteProduct& product) {
#if defined(__AVX512F__)
  static const bool has_vnni = __builtin_cpu_supports("avx512vnni");
  if (has_vnni) return MultiplyBlock<BytesByVnni, 6, 4>(product);
  return MultiplyBlock<BytesByPairs, 4, 2>(product);
#elif defined(HOLBA_SIMD_SCALAR)
  return MultiplyBlock<BytesByPairs, 2, 2>(product);
#else
  return MultiplyBlock<BytesByPairs, 3, 2>(product);
#endif
}

void MultiplyFloats(const FloatProduct& product) {
#if defined(__AVX512F__)
  return MultiplyBlock<Floats, 6, 4>(product);
#elif defined(HOLBA_SIMD_SCALAR)
  return MultiplyBlock<Floats, 2, 2>(product);
#else
  return MultiplyBlock<Floats, 4, 2>(product);
#endif
}

int StateLanes() { return kNumLanes; }

}  // namespace holba::HOLBA_SIMD_TARGET
