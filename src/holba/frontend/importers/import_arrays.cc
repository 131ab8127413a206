// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_arrays.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

struct Half {
  uint16_t bits;
};

float ToReal(Half half) {
  const uint32_t sign = static_cast<uint32_t>(half.bits & 0x8000u) << 16;
  const uint32_t exponent = (half.bits >> 10) & 0x1fu;
  const uint32_t fraction = half.bits & 0x3ffu;
  if (exponent == 0) {  // zero and subnormal numbers
    const float magnitude = std::ldexp(static_cast<float>(fraction), -24);
    return sign ? -magnitude : magnitude;
  }
  if (exponent == 31) return std::bit_cast<float>(sign | 0x7f800000u | (fraction << 13));
  return std::bit_cast<float>(sign | ((exponent + 112) << 23) | (fraction << 13));
}

template <typename To, typename From>
To Convert(From value) {
  if constexpr (std::is_same_v<From, Half>) {
    return Convert<To>(ToReal(value));
  } else if constexpr (std::is_same_v<To, int64_t> && std::is_floating_point_v<From>) {
    constexpr From kLimit = From(9223372036854775808.0);
    return value > -kLimit && value < kLimit ? static_cast<int64_t>(value)
                                             : std::numeric_limits<int64_t>::min();
  } else if constexpr (std::is_same_v<To, int64_t> && std::is_same_v<From, uint64_t>) {
    return value <= static_cast<uint64_t>(std::numeric_limits<int64_t>::max())
               ? static_cast<int64_t>(value)
               : std::numeric_limits<int64_t>::min();
  } else {
    return static_cast<To>(value);
  }
}

template <typename From, typename To>
void ConvertAll(const std::string& bytes, std::vector<To>* values) {
  for (size_t i = 0; i < values->size(); ++i) {
    From value;
    std::memcpy(&value, bytes.data() + i * sizeof(From), sizeof(From));
    (*values)[i] = Convert<To>(value);
  }
}

}  // namespace

size_t BytesOf(ElementType type) {
  switch (type) {
    case ElementType::kBool:
    case ElementType::kInt8:
    case ElementType::kUInt8:
      return 1;
    case ElementType::kInt16:
    case ElementType::kUInt16:
    case ElementType::kFloat16:
      return 2;
    case ElementType::kInt32:
    case ElementType::kUInt32:
    case ElementType::kFloat32:
      return 4;
    case ElementType::kInt64:
    case ElementType::kUInt64:
    case ElementType::kFloat64:
      return 8;
  }
  HOLBA_CHECK_MSG(false, "no such element type");
  return 0;
}

std::string_view NameOf(ElementType type) {
  constexpr std::string_view kNames[] = {"bool",   "int8",    "int16",   "int32",
                                         "int64",  "uint8",   "uint16",  "uint32",
                                         "uint64", "float16", "float32", "float64"};
  return kNames[static_cast<size_t>(type)];
}

uint64_t NumericArray::size() const {
  uint64_t product = 1;
  for (const uint64_t extent : shape) product *= extent;
  return product;
}

template <typename T>
std::vector<T> NumericArray::Values() const {
  HOLBA_CHECK(bytes.size() == size() * BytesOf(type));
  std::vector<T> values(size());
  switch (type) {
    case ElementType::kBool:
    case ElementType::kUInt8:
      ConvertAll<uint8_t>(bytes, &values);
      break;
    case ElementType::kInt8:
      ConvertAll<int8_t>(bytes, &values);
      break;
    case ElementType::kInt16:
      ConvertAll<int16_t>(bytes, &values);
      break;
    case ElementType::kInt32:
      ConvertAll<int32_t>(bytes, &values);
      break;
    case ElementType::kInt64:
      ConvertAll<int64_t>(bytes, &values);
      break;
    case ElementType::kUInt16:
      ConvertAll<uint16_t>(bytes, &values);
      break;
    case ElementType::kUInt32:
      ConvertAll<uint32_t>(bytes, &values);
      break;
    case ElementType::kUInt64:
      ConvertAll<uint64_t>(bytes, &values);
      break;
    case ElementType::kFloat16:
      ConvertAll<Half>(bytes, &values);
      break;
    case ElementType::kFloat32:
      ConvertAll<float>(bytes, &values);
      break;
    case ElementType::kFloat64:
      ConvertAll<double>(bytes, &values);
      break;
  }
  return values;
}
template std::vector<float> NumericArray::Values<float>() const;
template std::vector<double> NumericArray::Values<double>() const;
template std::vector<int64_t> NumericArray::Values<int64_t>() const;

std::string NumericArray::ShapeText() const {
  std::string text = "(";
  for (size_t i = 0; i < shape.size(); ++i) text += fmt::format("{}{}", i ? ", " : "", shape[i]);
  return text + (shape.size() == 1 ? ",) " : ") ") + std::string(NameOf(type));
}

bool ArrayBytes(const std::vector<uint64_t>& shape, ElementType type, uint64_t* bytes) {
  // Extents that follow a zero may be anything.
  for (const uint64_t extent : shape) {
    if (extent == 0) {
      *bytes = 0;
      return true;
    }
  }
  uint64_t product = BytesOf(type);
  for (const uint64_t extent : shape) {
    if (extent > kMaxArrayBytes / product) return false;
    product *= extent;
  }
  *bytes = product;
  return true;
}

}  // namespace holba
