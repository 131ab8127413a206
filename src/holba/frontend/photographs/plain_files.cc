// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/plain_files.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <string>

#include "holba/base/error.h"
#include "holba/frontend/photographs/decode_fault.h"

namespace holba {
namespace {

[[noreturn]] void Refuse(const std::filesystem::path& path, const char* format,
                         const std::string& why) {
  throw CannotBeDecoded(path, format, why);
}

DecodedImage MakeImage(int64_t width, int64_t height, const char* format,
                       const std::filesystem::path& path) {
  const auto most = static_cast<int64_t>(kMaxImageBytes / 3);
  if (width <= 0 || height <= 0 || width > most || height > most / width)
    Refuse(path, format, "its width or height is 0 or too large");
  DecodedImage image{static_cast<int>(width), static_cast<int>(height), {}};
  image.pixels.resize(3 * static_cast<size_t>(width) * static_cast<size_t>(height));
  return image;
}

// A channel of a BMP pixel of 16 or 32 bits.
struct Channel {
  uint32_t mask = 0;

  uint8_t Of(uint32_t pixel) const {
    if (mask == 0) return 0;
    const int shift = std::countr_zero(mask);
    const uint64_t largest = mask >> shift;
    return static_cast<uint8_t>((uint64_t{(pixel & mask) >> shift} * 255 + largest / 2) / largest);
  }
};

class BmpReader {
 public:
  BmpReader(std::string_view bytes, const std::filesystem::path& path)
      : bytes_(bytes), path_(path) {}

  DecodedImage Read() {
    const uint32_t header_size = U32(14);
    if (header_size < 40) Fail("files of OS/2 are not read");
    const auto width = static_cast<int32_t>(U32(18)), height = static_cast<int32_t>(U32(22));
    const uint32_t bits = U16(28), compression = U32(30);
    const bool has_masks = compression == kBitFields && (bits == 16 || bits == 32);
    if (compression != kUncompressed && !has_masks) Fail("compressed ones are not read");
    std::array<Channel, 3> channels{{{0x00ff0000}, {0x0000ff00}, {0x000000ff}}};
    if (bits == 16) channels = {{{0x7c00}, {0x03e0}, {0x001f}}};
    if (has_masks) channels = {{{U32(54)}, {U32(58)}, {U32(62)}}};
    // A negative height: the first row of the file is the top one.
    const int64_t num_rows = std::abs(int64_t{height});
    const uint64_t palette = 14 + uint64_t{header_size};
    const uint64_t first = U32(10);
    const uint64_t row_bytes = (uint64_t{bits} * static_cast<uint32_t>(width) + 31) / 32 * 4;
    // Before memory is asked for.
    if (first > bytes_.size() || row_bytes == 0 ||
        static_cast<uint64_t>(num_rows) > (bytes_.size() - first) / row_bytes) {
      Fail("it ends too early");
    }
    DecodedImage image = MakeImage(width, num_rows, kName, path_);
    for (int64_t y = 0; y < num_rows; ++y) {
      const uint64_t row = first + row_bytes * static_cast<uint64_t>(y);
      const int64_t to_row = height < 0 ? y : num_rows - 1 - y;
      uint8_t* rgb = &image.pixels[3 * static_cast<size_t>(to_row) * static_cast<size_t>(width)];
      for (uint32_t x = 0; x < static_cast<uint32_t>(width); ++x, rgb += 3) {
        if (bits == 16 || bits == 32) {
          const uint32_t pixel =
              bits == 16 ? U16(row + 2 * uint64_t{x}) : U32(row + 4 * uint64_t{x});
          for (int c = 0; c < 3; ++c) rgb[c] = channels[c].Of(pixel);
        } else if (bits == 24) {
          for (int c = 0; c < 3; ++c) rgb[c] = U8(row + 3 * uint64_t{x} + 2 - c);
        } else if (bits == 1 || bits == 4 || bits == 8) {
          const uint32_t per_byte = 8 / bits;
          const uint32_t shift = 8 - bits * (x % per_byte + 1);
          const uint32_t index = (U8(row + x / per_byte) >> shift) & ((1u << bits) - 1);
          const uint64_t colour = palette + 4 * uint64_t{index};
          // Blue comes first.
          for (int c = 0; c < 3; ++c) rgb[c] = colour + 4 <= first ? U8(colour + 2 - c) : 0;
        } else {
          Fail("its number of bits per pixel is not read");
        }
      }
    }
    return image;
  }

 private:
  static constexpr const char* kName = "BMP";
  static constexpr uint32_t kUncompressed = 0, kBitFields = 3;

  [[noreturn]] void Fail(const std::string& why) const { Refuse(path_, kName, why); }
  uint8_t U8(uint64_t at) const {
    if (at >= bytes_.size()) Fail("it ends too early");
    return static_cast<uint8_t>(bytes_[at]);
  }
  uint32_t U16(uint64_t at) const { return U8(at) | uint32_t{U8(at + 1)} << 8; }
  uint32_t U32(uint64_t at) const { return U16(at) | U16(at + 2) << 16; }

  std::string_view bytes_;
  const std::filesystem::path& path_;
};

class PnmReader {
 public:
  PnmReader(std::string_view bytes, const std::filesystem::path& path)
      : bytes_(bytes), path_(path) {}

  DecodedImage Read() {
    const int kind = bytes_[1] - '0';
    const bool is_text = kind <= 3, is_bits = kind == 1 || kind == 4;
    const int num_channels = kind == 3 || kind == 6 ? 3 : 1;
    const uint32_t width = Number(), height = Number();
    const uint32_t largest = is_bits ? 1 : Number();
    if (largest == 0 || largest > 65535) Fail("its largest value is not between 1 and 65535");
    // Before memory is asked for: the least that the rows can take.
    const uint64_t row_bytes =
        kind == 4 ? (uint64_t{width} + 7) / 8 : uint64_t{width} * num_channels;
    if (row_bytes == 0 || height > bytes_.size() / row_bytes) Fail("it ends too early");
    DecodedImage image = MakeImage(width, height, kName, path_);
    if (!is_text) ++at_;  // exactly one blank before the values
    uint8_t* rgb = image.pixels.data();
    for (uint32_t y = 0; y < height; ++y) {
      for (uint32_t x = 0; x < width; ++x, rgb += 3) {
        for (int c = 0; c < num_channels; ++c) {
          uint32_t value;
          if (is_bits) {
            // A one is black.
            value = 1 - (is_text ? Bit() : (Byte(at_ + x / 8) >> (7 - x % 8)) & 1u);
          } else {
            value = is_text ? Number() : largest > 255 ? Next() << 8 | Next() : Next();
          }
          rgb[c] = static_cast<uint8_t>((std::min(value, largest) * 255 + largest / 2) / largest);
        }
        for (int c = num_channels; c < 3; ++c) rgb[c] = rgb[0];
      }
      if (kind == 4) at_ += (size_t{width} + 7) / 8;
    }
    return image;
  }

 private:
  static constexpr const char* kName = "PNM";

  [[noreturn]] void Fail(const std::string& why) const { Refuse(path_, kName, why); }
  uint32_t Byte(size_t at) const {
    if (at >= bytes_.size()) Fail("it ends too early");
    return static_cast<uint8_t>(bytes_[at]);
  }
  uint32_t Next() { return Byte(at_++); }
  static bool IsBlank(uint32_t c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
  static bool IsDigit(uint32_t c) { return c >= '0' && c <= '9'; }

  void SkipBlanks() {
    while (IsBlank(Byte(at_)) || Byte(at_) == '#') {
      if (Next() != '#') continue;
      while (Byte(at_) != '\n') ++at_;
    }
  }
  uint32_t Number() {
    SkipBlanks();
    if (!IsDigit(Byte(at_))) Fail("expected a number, found something else");
    uint32_t number = 0;
    for (; at_ < bytes_.size() && IsDigit(Byte(at_)); ++at_) {
      if (number > 100'000'000) Fail("a number in it is too large");
      number = 10 * number + (Byte(at_) - '0');
    }
    return number;
  }
  // Bits of text need no blanks between them.
  uint32_t Bit() {
    SkipBlanks();
    const uint32_t bit = Next() - '0';
    if (bit > 1) Fail("expected 0 or 1, found something else");
    return bit;
  }

  std::string_view bytes_;
  const std::filesystem::path& path_;
  size_t at_ = 2;
};

}  // namespace

DecodedImage ParseBmp(std::string_view bytes, const std::filesystem::path& path) {
  return BmpReader(bytes, path).Read();
}

DecodedImage ParsePnm(std::string_view bytes, const std::filesystem::path& path) {
  return PnmReader(bytes, path).Read();
}

}  // namespace holba
