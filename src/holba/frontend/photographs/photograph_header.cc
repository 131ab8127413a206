// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/photograph_header.h"

#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>

#include "holba/frontend/photographs/photograph.h"

namespace holba {
namespace {

using namespace std::string_view_literals;

uint32_t BigEndian(std::string_view bytes) {
  uint32_t value = 0;
  for (const char c : bytes) value = (value << 8) | static_cast<uint8_t>(c);
  return value;
}

// Empty: the file has not so many.
std::optional<std::string> Read(std::ifstream* file, size_t count) {
  std::string bytes(count, '\0');
  file->read(bytes.data(), static_cast<std::streamsize>(count));
  if (!*file) return std::nullopt;
  return bytes;
}

// Segment by segment up to the pixels. Empty: no size was found.
std::optional<PhotographHeader> ReadJpegHeader(std::ifstream* file) {
  constexpr std::string_view kExif = "Exif\0\0"sv;
  PhotographHeader header;
  bool has_exif = false;
  file->seekg(2);
  while (true) {
    int byte = file->get();
    if (byte != 0xff) return std::nullopt;
    while (byte == 0xff) byte = file->get();
    const int marker = byte;
    if (marker == 0x01 || (marker >= 0xd0 && marker <= 0xd7)) continue;  // without content
    // The image's end, or pixels.
    if (marker == std::ifstream::traits_type::eof() || marker == 0xd9 || marker == 0xda) break;
    const auto size_bytes = Read(file, 2);
    if (!size_bytes) break;
    const uint32_t size = BigEndian(*size_bytes);
    if (size < 2) break;
    // Start of frame, of any kind of coding.
    const bool is_frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if ((marker == 0xe1 && !has_exif) || is_frame) {
      const auto content = Read(file, size - 2);
      if (!content) break;
      const std::string_view bytes = *content;
      if (is_frame && bytes.size() >= 5) {
        header.height = BigEndian(bytes.substr(1, 2));
        header.width = BigEndian(bytes.substr(3, 2));
      } else if (bytes.starts_with(kExif)) {
        header.exif = ParseExif(bytes.substr(kExif.size()));
        has_exif = true;
      }
    } else {
      file->seekg(size - 2, std::ios::cur);
    }
  }
  if (header.width == 0 || header.height == 0) return std::nullopt;
  return header;
}

std::optional<PhotographHeader> ReadPngHeader(std::ifstream* file) {
  PhotographHeader header;
  file->seekg(8);
  // Chunk by chunk: the size is in the first one, EXIF may be behind the pixels.
  while (const auto begin = Read(file, 8)) {
    const uint32_t size = BigEndian(std::string_view(*begin).substr(0, 4));
    const std::string_view type = std::string_view(*begin).substr(4);
    constexpr uint32_t kLargestExif = 1 << 24;
    if ((type == "IHDR" && size >= 8) || (type == "eXIf" && size <= kLargestExif)) {
      const auto content = Read(file, size);
      if (!content) break;
      if (type == "IHDR") {
        header.width = BigEndian(std::string_view(*content).substr(0, 4));
        header.height = BigEndian(std::string_view(*content).substr(4, 4));
      } else {
        header.exif = ParseExif(*content);
      }
      file->seekg(4, std::ios::cur);
    } else {
      file->seekg(static_cast<std::streamoff>(size) + 4, std::ios::cur);
    }
  }
  if (header.width == 0 || header.height == 0) return std::nullopt;
  return header;
}

std::optional<PhotographHeader> ReadTiffHeader(std::ifstream* file) {
  file->seekg(0);
  const std::string bytes{std::istreambuf_iterator<char>(*file), {}};
  PhotographHeader header;
  header.exif = ParseExif(bytes);
  header.width = header.exif.width.value_or(0);
  header.height = header.exif.height.value_or(0);
  if (header.width == 0 || header.height == 0) return std::nullopt;
  return header;
}

}  // namespace

PhotographHeader ReadPhotographHeader(const std::filesystem::path& path) {
  std::optional<PhotographHeader> header;
  std::error_code error;
  std::ifstream file;
  if (std::filesystem::is_regular_file(path, error)) file.open(path, std::ios::binary);
  if (const auto head = file.is_open() ? Read(&file, 8) : std::nullopt) {
    if (head->starts_with("\xff\xd8\xff"sv)) {
      header = ReadJpegHeader(&file);
    } else if (*head == "\x89PNG\r\n\x1a\n"sv) {
      header = ReadPngHeader(&file);
    } else if (head->starts_with("II*\0"sv) || head->starts_with("MM\0*"sv)) {
      header = ReadTiffHeader(&file);
    }
  }
  if (header) return *header;
  // Small formats, rare ones, and what is damaged: the reader says what is wrong.
  const GreyImage image = ReadGreyImage(path);
  return {static_cast<uint64_t>(image.width), static_cast<uint64_t>(image.height), {}};
}

}  // namespace holba
