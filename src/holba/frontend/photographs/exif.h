// SPDX-License-Identifier: BSD-3-Clause
// What a camera wrote into a photograph about itself (EXIF 2.3, TIFF 6.0), as far as a
// reconstruction uses it, and what COLMAP makes of it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace holba {

struct Exif {
  std::optional<uint64_t> width, height;  // of the image, in TIFF files
  std::optional<std::string> make, model;
  std::optional<int> orientation;  // 1 to 8: how the picture is to be turned (1: as it is)
  std::optional<double> focal_length_mm;
  std::optional<double> focal_length_35mm;  // of a camera with 35 mm film that shows the same
  std::optional<double> focal_plane_x_resolution;  // pixels in the unit below
  std::optional<int> focal_plane_unit;             // 2: inch, 3: cm, 4: mm, 5: um
  // WGS84; south and west are negative, altitudes below the sea, too.
  std::optional<double> latitude_deg, longitude_deg, altitude_m;
};

// `tiff`: what a TIFF file, or the part of another file that holds EXIF, consists of. What is
// damaged or missing is left out; nothing is read beyond the bytes.
Exif ParseExif(std::string_view tiff);

// Focal length in pixels of a photograph of this size, by COLMAP's rule: from the length on 35 mm
// film by the diagonal (43.27 mm), else from the resolution of the sensor. Empty: not known.
std::optional<double> FocalLengthPx(const Exif& exif, uint64_t width, uint64_t height);

// Photographs with the same text were taken by one camera with one focal length: COLMAP gives them
// one camera. Empty: nothing is known about the camera.
std::optional<std::string> CameraText(const Exif& exif, uint64_t width, uint64_t height);

// By how many quarter turns, counter-clockwise as seen, the picture has to be turned to be upright;
// 0 for what is mirrored or unknown, as in COLMAP.
int QuarterTurnsToUpright(const Exif& exif);

}  // namespace holba
