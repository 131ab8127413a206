// SPDX-License-Identifier: BSD-3-Clause
// Writes EXIF for tests, and puts it into JPEG and PNG files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace holba {

class ExifWriter {
 public:
  enum Directory { kMain, kCamera, kGps };

  explicit ExifWriter(bool big_endian) : big_endian_(big_endian) {}

  void Text(Directory directory, uint16_t tag, const std::string& text) {
    Add(directory, tag, 2, static_cast<uint32_t>(text.size() + 1), text + '\0');
  }
  void Byte(Directory directory, uint16_t tag, uint8_t value) {
    Add(directory, tag, 1, 1, std::string(1, static_cast<char>(value)));
  }
  void Short(Directory directory, uint16_t tag, uint16_t value) {
    Add(directory, tag, 3, 1, Number(value, 2));
  }
  void Rationals(Directory directory, uint16_t tag,
                 const std::vector<std::pair<uint32_t, uint32_t>>& values) {
    std::string bytes;
    for (const auto& [n, d] : values) bytes += Number(n, 4) + Number(d, 4);
    Add(directory, tag, 5, static_cast<uint32_t>(values.size()), bytes);
  }

  // Directories one behind the other, each followed by its longer values.
  std::string Bytes() const {
    std::vector<Entry> main = entries_[kMain];
    std::string camera_at(4, '\0'), gps_at(4, '\0');
    const uint32_t main_size = SizeOf(entries_[kMain], 2);
    const uint32_t camera_begin = 8 + main_size;
    const uint32_t gps_begin = camera_begin + SizeOf(entries_[kCamera], 0);
    main.push_back({0x8769, 4, 1, Number(camera_begin, 4)});
    main.push_back({0x8825, 4, 1, Number(gps_begin, 4)});
    std::string bytes = big_endian_ ? "MM" : "II";
    bytes += Number(42, 2) + Number(8, 4);
    Append(main, &bytes);
    Append(entries_[kCamera], &bytes);
    Append(entries_[kGps], &bytes);
    return bytes;
  }

 private:
  struct Entry {
    uint16_t tag, type;
    uint32_t count;
    std::string bytes;
  };

  void Add(Directory directory, uint16_t tag, uint16_t type, uint32_t count, std::string bytes) {
    entries_[directory].push_back({tag, type, count, std::move(bytes)});
  }
  std::string Number(uint32_t value, int size) const {
    std::string bytes;
    for (int i = 0; i < size; ++i)
      bytes += static_cast<char>(value >> (8 * (big_endian_ ? size - 1 - i : i)));
    return bytes;
  }
  static uint32_t SizeOf(const std::vector<Entry>& entries, size_t num_more) {
    size_t size = 2 + 12 * (entries.size() + num_more) + 4;
    for (const Entry& entry : entries) size += entry.bytes.size() > 4 ? entry.bytes.size() : 0;
    return static_cast<uint32_t>(size);
  }
  void Append(const std::vector<Entry>& entries, std::string* bytes) const {
    std::string values;
    const size_t values_at = bytes->size() + 2 + 12 * entries.size() + 4;
    *bytes += Number(static_cast<uint32_t>(entries.size()), 2);
    for (const Entry& entry : entries) {
      *bytes += Number(entry.tag, 2) + Number(entry.type, 2) + Number(entry.count, 4);
      if (entry.bytes.size() > 4) {
        *bytes += Number(static_cast<uint32_t>(values_at + values.size()), 4);
        values += entry.bytes;
      } else {
        *bytes += entry.bytes + std::string(4 - entry.bytes.size(), '\0');
      }
    }
    *bytes += Number(0, 4) + values;
  }

  bool big_endian_;
  std::vector<Entry> entries_[3];
};

// Puts EXIF into a file that WriteImage wrote.
inline void AddExif(const std::filesystem::path& path, const std::string& exif) {
  std::ifstream in(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  in.close();
  const auto big_endian = [](size_t value, int size) {
    std::string text;
    for (int i = size - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i));
    return text;
  };
  if (path.extension() == ".png") {
    std::string chunk = "eXIf" + exif;
    uint32_t crc = 0xffffffffu;
    for (const char c : chunk) {
      crc ^= static_cast<uint8_t>(c);
      for (int k = 0; k < 8; ++k) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0u);
    }
    chunk = big_endian(exif.size(), 4) + chunk + big_endian(~crc, 4);
    bytes.insert(8 + 25, chunk);  // behind the header's chunk
  } else {
    const std::string content = std::string("Exif\0\0", 6) + exif;
    bytes.insert(2, "\xff\xe1" + big_endian(content.size() + 2, 2) + content);
  }
  std::ofstream(path, std::ios::binary) << bytes;
}

}  // namespace holba
