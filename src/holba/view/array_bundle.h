// SPDX-License-Identifier: BSD-3-Clause
// Named arrays of numbers and one JSON value as bytes, for pages: what JavaScript takes as typed
// arrays without looking at single numbers.
//   "HVB1", uint32 length of the JSON, the JSON (ASCII), then from the next multiple of 8 on the
//   arrays, each at a multiple of 8 from there. All little-endian.
// The JSON is {"meta": ..., "arrays": {name: {"type": "f32", "offset": bytes, "length": numbers}}}.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace holba {

class ArrayBundle {
 public:
  void Add(const std::string& name, std::span<const float> values);     // "f32"
  void Add(const std::string& name, std::span<const uint32_t> values);  // "u32"
  void Add(const std::string& name, std::span<const uint16_t> values);  // "u16"
  void Add(const std::string& name, std::span<const int16_t> values);   // "i16"
  void Add(const std::string& name, std::span<const uint8_t> values);   // "u8"
  // As half-precision numbers, "f16": what is beyond their range becomes their greatest.
  void AddHalf(const std::string& name, std::span<const float> values);

  // So far, without the JSON.
  size_t NumBytes() const { return bytes_.size(); }
  // Names in `meta` may hold any bytes: what is no UTF-8 is replaced.
  std::string ToBytes(nlohmann::json meta) const;

 private:
  void Append(const std::string& name, const char* type, const void* data, size_t length,
              size_t size);

  nlohmann::json arrays_ = nlohmann::json::object();
  std::string bytes_;
};

// IEEE 754 binary16 nearest to a finite number, saturated. NaN becomes 0.
uint16_t HalfOf(float value);

// zlib's format, which a page opens by DecompressionStream("deflate").
std::string Deflate(std::string_view bytes);
std::string Base64(std::string_view bytes);

}  // namespace holba
