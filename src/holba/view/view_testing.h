// SPDX-License-Identifier: BSD-3-Clause
// What the tests of this folder read pages with: independent of what writes them.
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/base64_testing.h"

namespace holba {

inline float FloatOfHalf(uint16_t half) {
  const int exponent = half >> 10 & 31, fraction = half & 1023;
  const float magnitude = exponent == 0 ? std::ldexp(static_cast<float>(fraction), -24)
                                        : std::ldexp(1.0f + fraction / 1024.0f, exponent - 15);
  return half & 0x8000 ? -magnitude : magnitude;
}

inline std::string Inflated(const std::string& bytes) {
  std::string out;
  z_stream stream{};
  EXPECT_EQ(inflateInit(&stream), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  int status = Z_OK;
  while (status == Z_OK) {
    char piece[4096];
    stream.next_out = reinterpret_cast<Bytef*>(piece);
    stream.avail_out = sizeof(piece);
    status = inflate(&stream, Z_NO_FLUSH);
    out.append(piece, sizeof(piece) - stream.avail_out);
  }
  EXPECT_EQ(status, Z_STREAM_END);
  inflateEnd(&stream);
  return out;
}

struct ReadBundle {
  explicit ReadBundle(const std::string& all) {
    EXPECT_EQ(all.substr(0, 4), "HVB1");
    uint32_t length = 0;
    std::memcpy(&length, &all[4], 4);
    const auto json = nlohmann::json::parse(all.substr(8, length));
    meta = json["meta"];
    arrays = json["arrays"];
    data = all.substr((8 + length + 7) / 8 * 8);
  }

  template <typename T>
  std::vector<T> Get(const std::string& name) const {
    const auto& array = arrays.at(name);
    const size_t offset = array["offset"];
    EXPECT_EQ(offset % 8, 0u);
    std::vector<T> values(array["length"].get<size_t>());
    EXPECT_LE(offset + values.size() * sizeof(T), data.size());
    if (!values.empty()) std::memcpy(values.data(), &data[offset], values.size() * sizeof(T));
    return values;
  }
  std::vector<float> GetHalves(const std::string& name) const {
    std::vector<float> values;
    for (const uint16_t half : Get<uint16_t>(name)) values.push_back(FloatOfHalf(half));
    return values;
  }

  nlohmann::json meta, arrays;
  std::string data;
};

}  // namespace holba
