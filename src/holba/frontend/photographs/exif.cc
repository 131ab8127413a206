// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/exif.h"

#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <vector>

namespace holba {
namespace {

constexpr double kDiagonalOf35mmFilm = 43.27;

enum Tag : uint16_t {
  kWidth = 0x0100,
  kHeight = 0x0101,
  kMake = 0x010F,
  kModel = 0x0110,
  kOrientation = 0x0112,
  kExifDirectory = 0x8769,
  kGpsDirectory = 0x8825,
  kFocalLength = 0x920A,
  kFocalPlaneXResolution = 0xA20E,
  kFocalPlaneUnit = 0xA210,
  kFocalLength35mm = 0xA405,
};
enum GpsTag : uint16_t {
  kLatitudeRef = 1,
  kLatitude = 2,
  kLongitudeRef = 3,
  kLongitude = 4,
  kAltitudeRef = 5,
  kAltitude = 6,
};

// One entry of a directory: where its values lie.
struct Entry {
  uint16_t tag = 0, type = 0;
  uint32_t count = 0;
  size_t offset = 0;
};

class TiffReader {
 public:
  explicit TiffReader(std::string_view bytes) : bytes_(bytes) {}

  Exif Read() {
    Exif exif;
    if (bytes_.size() < 8) return exif;
    is_big_endian_ = bytes_[0] == 'M';
    if (!(bytes_.starts_with("II") || bytes_.starts_with("MM")) || U16(2) != 42) return exif;
    for (const Entry& entry : Directory(U32(4))) {
      switch (entry.tag) {
        case kWidth:
          exif.width = Unsigned(entry);
          break;
        case kHeight:
          exif.height = Unsigned(entry);
          break;
        case kMake:
          exif.make = Text(entry);
          break;
        case kModel:
          exif.model = Text(entry);
          break;
        case kOrientation:
          exif.orientation = ToInt(Number(entry));
          break;
        case kExifDirectory:
          if (const auto at = Unsigned(entry)) ReadCamera(*at, &exif);
          break;
        case kGpsDirectory:
          if (const auto at = Unsigned(entry)) ReadGps(*at, &exif);
          break;
        default:
          break;
      }
    }
    return exif;
  }

 private:
  void ReadCamera(uint64_t at, Exif* exif) const {
    for (const Entry& entry : Directory(at)) {
      switch (entry.tag) {
        case kFocalLength:
          exif->focal_length_mm = Number(entry);
          break;
        case kFocalPlaneXResolution:
          exif->focal_plane_x_resolution = Number(entry);
          break;
        case kFocalPlaneUnit:
          exif->focal_plane_unit = ToInt(Number(entry));
          break;
        case kFocalLength35mm:
          exif->focal_length_35mm = Number(entry);
          break;
        default:
          break;
      }
    }
  }

  void ReadGps(uint64_t at, Exif* exif) const {
    bool is_south = false, is_west = false, is_below = false;
    for (const Entry& entry : Directory(at)) {
      switch (entry.tag) {
        case kLatitudeRef:
          is_south = BeginsWith(entry, 'S');
          break;
        case kLatitude:
          exif->latitude_deg = Degrees(entry);
          break;
        case kLongitudeRef:
          is_west = BeginsWith(entry, 'W');
          break;
        case kLongitude:
          exif->longitude_deg = Degrees(entry);
          break;
        case kAltitudeRef:
          is_below = Number(entry) == 1.0;
          break;
        case kAltitude:
          exif->altitude_m = Number(entry);
          break;
        default:
          break;
      }
    }
    // Some programs write the sign into the number.
    const auto negate = [](bool negative, std::optional<double>* value) {
      if (negative && *value && **value > 0.0) *value = -**value;
    };
    negate(is_south, &exif->latitude_deg);
    negate(is_west, &exif->longitude_deg);
    negate(is_below, &exif->altitude_m);
  }

  // The entries whose values lie within the bytes.
  std::vector<Entry> Directory(uint64_t at) const {
    std::vector<Entry> entries;
    if (at + 2 > bytes_.size()) return entries;
    const size_t count = U16(at);
    for (size_t i = 0; i < count && at + 2 + 12 * (i + 1) <= bytes_.size(); ++i) {
      const size_t begin = at + 2 + 12 * i;
      Entry entry{U16(begin), U16(begin + 2), U32(begin + 4)};
      const uint64_t size = SizeOf(entry.type) * uint64_t{entry.count};
      entry.offset = size <= 4 ? begin + 8 : U32(begin + 8);
      if (size == 0 || entry.offset + size > bytes_.size()) continue;
      entries.push_back(entry);
    }
    return entries;
  }

  static uint64_t SizeOf(uint16_t type) {
    switch (type) {
      case 1:  // byte
      case 2:  // text
      case 6:  // signed byte
      case 7:  // anything
        return 1;
      case 3:  // short
      case 8:
        return 2;
      case 4:  // long
      case 9:
      case 11:  // float
        return 4;
      case 5:  // rational
      case 10:
      case 12:  // double
        return 8;
      default:
        return 0;
    }
  }

  // Value `i` of an entry. Empty: it has none, or it is no number (a rational n/0).
  std::optional<double> Number(const Entry& entry, size_t i = 0) const {
    if (i >= entry.count) return std::nullopt;
    const size_t at = entry.offset + i * SizeOf(entry.type);
    switch (entry.type) {
      case 1:
      case 7:
        return static_cast<uint8_t>(bytes_[at]);
      case 3:
        return U16(at);
      case 4:
        return U32(at);
      case 9:
        return static_cast<int32_t>(U32(at));
      case 5: {
        const double denominator = U32(at + 4);
        if (denominator == 0.0) return std::nullopt;
        return U32(at) / denominator;
      }
      case 10: {
        const double denominator = static_cast<int32_t>(U32(at + 4));
        if (denominator == 0.0) return std::nullopt;
        return static_cast<int32_t>(U32(at)) / denominator;
      }
      default:
        return std::nullopt;
    }
  }

  std::optional<uint64_t> Unsigned(const Entry& entry) const {
    const std::optional<double> value = Number(entry);
    if (!value || *value < 0.0) return std::nullopt;
    return static_cast<uint64_t>(*value);
  }

  static std::optional<int> ToInt(const std::optional<double>& value) {
    if (!value || std::abs(*value) > 1e6) return std::nullopt;
    return static_cast<int>(*value);
  }

  // Without what follows its end and blanks around it.
  std::optional<std::string> Text(const Entry& entry) const {
    if (entry.type != 2) return std::nullopt;
    std::string_view text = bytes_.substr(entry.offset, entry.count);
    text = text.substr(0, text.find('\0'));
    const size_t first = text.find_first_not_of(' ');
    if (first == std::string_view::npos) return std::nullopt;
    return std::string(text.substr(first, text.find_last_not_of(' ') - first + 1));
  }

  bool BeginsWith(const Entry& entry, char letter) const {
    return std::toupper(static_cast<unsigned char>(bytes_[entry.offset])) == letter;
  }

  // Degrees, minutes, seconds.
  std::optional<double> Degrees(const Entry& entry) const {
    const auto degrees = Number(entry, 0), minutes = Number(entry, 1), seconds = Number(entry, 2);
    if (!degrees) return std::nullopt;
    return *degrees + minutes.value_or(0.0) / 60.0 + seconds.value_or(0.0) / 3600.0;
  }

  // Callers have made sure that the bytes are there.
  uint16_t U16(size_t at) const {
    const auto a = static_cast<uint8_t>(bytes_[at]), b = static_cast<uint8_t>(bytes_[at + 1]);
    return static_cast<uint16_t>(is_big_endian_ ? (a << 8) | b : (b << 8) | a);
  }
  uint32_t U32(size_t at) const {
    const uint32_t first = U16(at), second = U16(at + 2);
    return is_big_endian_ ? (first << 16) | second : (second << 16) | first;
  }

  std::string_view bytes_;
  bool is_big_endian_ = false;
};

}  // namespace

Exif ParseExif(std::string_view tiff) { return TiffReader(tiff).Read(); }

std::optional<double> FocalLengthPx(const Exif& exif, uint64_t width, uint64_t height) {
  if (exif.focal_length_35mm && *exif.focal_length_35mm > 0.0) {
    const double diagonal = std::hypot(static_cast<double>(width), static_cast<double>(height));
    return *exif.focal_length_35mm / kDiagonalOf35mmFilm * diagonal;
  }
  if (!exif.focal_length_mm || !exif.focal_plane_x_resolution || !exif.focal_plane_unit)
    return std::nullopt;
  if (!(*exif.focal_length_mm > 0.0 && *exif.focal_plane_x_resolution > 0.0)) return std::nullopt;
  double mm = 0.0;
  switch (*exif.focal_plane_unit) {
    case 2:
      mm = 25.4;
      break;
    case 3:
      mm = 10.0;
      break;
    case 4:
      mm = 1.0;
      break;
    case 5:
      mm = 0.001;
      break;
    default:
      return std::nullopt;
  }
  return *exif.focal_length_mm * *exif.focal_plane_x_resolution / mm;
}

std::optional<std::string> CameraText(const Exif& exif, uint64_t width, uint64_t height) {
  const auto focal = exif.focal_length_35mm ? exif.focal_length_35mm : exif.focal_length_mm;
  if (!exif.make || !exif.model || !focal) return std::nullopt;
  return fmt::format("{}-{}-{:.6f}-{}x{}", *exif.make, *exif.model, *focal, width, height);
}

int QuarterTurnsToUpright(const Exif& exif) {
  switch (exif.orientation.value_or(1)) {
    case 3:
      return 2;
    case 6:  // to be turned clockwise once
      return 3;
    case 8:
      return 1;
    default:
      return 0;
  }
}

}  // namespace holba
