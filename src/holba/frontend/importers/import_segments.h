// SPDX-License-Identifier: BSD-3-Clause
// Line segments that other detectors wrote: as text, numpy's npy and npz, or HDF5 (docs: Importing
// features).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/options.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/geometry/line.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Where the centre of the top-left pixel is in a file's coordinates. By format: 0.5 in text (as
// COLMAP's files), 0 in npy, npz and HDF5 (the indices of arrays, as hloc and most networks).
enum class PixelCentre { kByFormat, kZero, kHalf };

struct SegmentImportOptions {
  PixelCentre pixel_centre = PixelCentre::kByFormat;
  // Detectors run over the rim a little; what is further outside has other units, or is of another
  // photograph.
  double max_outside_px = 2.0;
  void Describe(OptionTable* table) const;
};

// The segments of one image as a file has them, in the pixels that it counts in.
struct RawSegments {
  std::vector<LineSegment2d> segments;
  std::vector<float> scores;  // for each segment; empty: none
  // descriptor_size values for each; empty: none.
  std::vector<float> descriptors;
  size_t descriptor_size = 0;
  std::optional<PixelCentre> pixel_centre;    // as the file says
  std::optional<Eigen::Vector2d> image_size;  // width and height that the pixels refer to
  bool is_text = false;
  std::string place;  // for messages
};

// By the names that the file uses for its images. `path`: a folder of files (.txt, .npz, .npy), or
// one file. Throws InputError naming the file, the place and the remedy: wrong shape, not finite.
std::map<std::string, RawSegments> ReadSegments(const std::filesystem::path& path);
// One text file; segments before the first IMAGE belong to `image_name`.
std::map<std::string, RawSegments> ParseSegmentText(std::string_view bytes,
                                                    const std::filesystem::path& path,
                                                    const std::string& image_name);

struct ImportedSegments {
  std::vector<LineSegment2d> segments;  // pixels of the photograph, COLMAP's centre
  std::vector<float> scores;            // for each segment; empty: none
  // kSegmentDescriptorSize values of unit norm for each segment; empty: the file has none, or of
  // another size (those only their own matcher can compare: import its matches).
  std::vector<float> descriptors;
  // For each segment of the file its index above, kInvalidId32 if it was dropped.
  std::vector<line2D_t> idx_of_row;
};

struct SegmentImportReport {
  size_t num_images = 0;  // with a list of segments, which may be empty
  size_t num_segments = 0;
  size_t num_images_without = 0;  // images of the model that the file does not name
  size_t num_unknown_names = 0;   // names that are no image of the model
  size_t num_unused_descriptors = 0;
  std::map<std::string, size_t> dropped;  // segments, by reason
};

// The segments of the model's images. Throws InputError, also where no name is an image's.
std::map<image_t, ImportedSegments> ImportSegments(const std::filesystem::path& path,
                                                   const Reconstruction& model,
                                                   const SegmentImportOptions& options,
                                                   SegmentImportReport* report);

}  // namespace holba
