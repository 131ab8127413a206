// SPDX-License-Identifier: BSD-3-Clause
#include "holba/view/array_bundle.h"

#include <zlib.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "holba/base/check.h"

namespace holba {
namespace {

constexpr size_t kAlignment = 8;
// Beyond 6 zlib takes twice the time for a hundredth of the size.
constexpr int kLevel = 6;

void Pad(std::string* bytes) {
  bytes->append((kAlignment - bytes->size() % kAlignment) % kAlignment, '\0');
}

}  // namespace

uint16_t HalfOf(float value) {
  if (std::isnan(value)) return 0;
  const uint16_t sign = std::signbit(value) ? 0x8000 : 0;
  constexpr float kGreatest = 65504.0f, kLeastNormal = 6.103515625e-05f;
  const float magnitude = std::min(std::abs(value), kGreatest);
  // Below the least normal number steps are even.
  if (magnitude < kLeastNormal)
    return sign | static_cast<uint16_t>(std::nearbyint(magnitude * 16777216.0f));
  const auto bits = std::bit_cast<uint32_t>(magnitude);
  // To nearest, ties to even; a carry goes on into the exponent as it should.
  const uint32_t rounded = (bits + 0x0fff + ((bits >> 13) & 1)) >> 13;
  const uint32_t half = rounded - ((127 - 15) << 10);
  return sign | static_cast<uint16_t>(std::min<uint32_t>(half, 0x7bff));
}

void ArrayBundle::Append(const std::string& name, const char* type, const void* data, size_t length,
                         size_t size) {
  static_assert(std::endian::native == std::endian::little);
  HOLBA_CHECK(!arrays_.contains(name));
  Pad(&bytes_);
  arrays_[name] = {{"type", type}, {"offset", bytes_.size()}, {"length", length}};
  bytes_.append(static_cast<const char*>(data), length * size);
}

void ArrayBundle::Add(const std::string& name, std::span<const float> values) {
  Append(name, "f32", values.data(), values.size(), 4);
}
void ArrayBundle::Add(const std::string& name, std::span<const uint32_t> values) {
  Append(name, "u32", values.data(), values.size(), 4);
}
void ArrayBundle::Add(const std::string& name, std::span<const uint16_t> values) {
  Append(name, "u16", values.data(), values.size(), 2);
}
void ArrayBundle::Add(const std::string& name, std::span<const int16_t> values) {
  Append(name, "i16", values.data(), values.size(), 2);
}
void ArrayBundle::Add(const std::string& name, std::span<const uint8_t> values) {
  Append(name, "u8", values.data(), values.size(), 1);
}

void ArrayBundle::AddHalf(const std::string& name, std::span<const float> values) {
  std::vector<uint16_t> halves;
  halves.reserve(values.size());
  for (const float value : values) halves.push_back(HalfOf(value));
  Append(name, "f16", halves.data(), halves.size(), 2);
}

std::string ArrayBundle::ToBytes(nlohmann::json meta) const {
  const std::string json = nlohmann::json{{"meta", std::move(meta)}, {"arrays", arrays_}}.dump(
      -1, ' ', true, nlohmann::json::error_handler_t::replace);
  std::string all = "HVB1";
  const auto length = static_cast<uint32_t>(json.size());
  all.append(reinterpret_cast<const char*>(&length), sizeof(length));
  all += json;
  Pad(&all);
  return all + bytes_;
}

std::string Deflate(std::string_view bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string deflated(size, '\0');
  const int status = compress2(reinterpret_cast<Bytef*>(deflated.data()), &size,
                               reinterpret_cast<const Bytef*>(bytes.data()),
                               static_cast<uLong>(bytes.size()), kLevel);
  HOLBA_CHECK(status == Z_OK);
  deflated.resize(size);
  return deflated;
}

std::string Base64(std::string_view bytes) {
  static constexpr char kLetters[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t three = 0;
    for (size_t k = 0; k < 3; ++k) {
      three = three << 8 | (i + k < bytes.size() ? static_cast<uint8_t>(bytes[i + k]) : 0);
    }
    for (size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? kLetters[three >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace holba
