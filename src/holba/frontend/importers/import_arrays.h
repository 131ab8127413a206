// SPDX-License-Identifier: BSD-3-Clause
// Arrays of numbers as files of other programs hold them (npy, npz, HDF5), and what their readers
// share. Sizes in files are never trusted: nothing is allocated that the file's own bytes or
// kMaxArrayBytes do not bound.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace holba {

enum class ElementType : uint8_t {
  kBool,
  kInt8,
  kInt16,
  kInt32,
  kInt64,
  kUInt8,
  kUInt16,
  kUInt32,
  kUInt64,
  kFloat16,
  kFloat32,
  kFloat64,
};
size_t BytesOf(ElementType type);
std::string_view NameOf(ElementType type);  // numpy's: "float32"

// Normals of a photograph of 40 megapixels as float64 are below it.
inline constexpr uint64_t kMaxArrayBytes = uint64_t{1} << 30;

struct NumericArray {
  std::vector<uint64_t> shape;
  ElementType type = ElementType::kFloat64;
  std::string bytes;  // row by row (C order), byte order of this machine

  uint64_t size() const;  // number of elements
  // T: float, double or int64_t. Reals become integers by truncation; NaN and what does not fit
  // become the smallest int64_t.
  template <typename T>
  std::vector<T> Values() const;
  std::string ShapeText() const;  // "(12, 4) float32"
};

// The product, and whether the array may be that large. False: more than kMaxArrayBytes.
bool ArrayBytes(const std::vector<uint64_t>& shape, ElementType type, uint64_t* bytes);

}  // namespace holba
