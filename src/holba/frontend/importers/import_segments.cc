// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_segments.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/frontend/importers/import_names.h"
#include "holba/frontend/importers/import_store.h"
#include "holba/frontend/importers/import_text.h"
#include "holba/scene/image_features.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

// Names of an image's array of segments, best first. Keypoints may be lines (N, 4), too.
constexpr std::array<std::string_view, 5> kSegmentKeys = {"lines", "segments", "line_segments",
                                                          "lines2D", "keypoints"};
constexpr std::array<std::string_view, 2> kDescriptorKeys = {"line_descriptors", "descriptors"};
constexpr std::array<std::string_view, 3> kSegmentScoreKeys = {"line_scores", "scores",
                                                               "keypoint_scores"};
constexpr std::string_view kPixelCentreKey = "pixel_centre";
constexpr std::string_view kImageSizeKey = "image_size";

template <size_t n>
bool IsOneOf(const std::array<std::string_view, n>& keys, std::string_view key) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

bool IsKey(std::string_view key) {
  return IsOneOf(kSegmentKeys, key) || IsOneOf(kDescriptorKeys, key) ||
         IsOneOf(kSegmentScoreKeys, key) || key == kPixelCentreKey || key == kImageSizeKey;
}

// Values for each segment: 4, or 5 with a score; 0: the shape is not one of segments.
uint64_t NumColumns(const NumericArray& array) {
  const std::vector<uint64_t>& shape = array.shape;
  if (shape.size() == 2 && (shape[1] == 4 || shape[1] == 5)) return shape[1];
  if (shape.size() == 3 && shape[1] == 2 && shape[2] == 2) return 4;
  return 0;
}

// An image without segments: whatever has no rows.
bool HasNoRows(const NumericArray& array) { return !array.shape.empty() && array.shape[0] == 0; }

void TakeSegments(const StoredArray& stored, RawSegments* raw) {
  const NumericArray& array = stored.array;
  raw->place = stored.place;
  if (HasNoRows(array)) return;
  const uint64_t columns = NumColumns(array);
  if (columns == 0) {
    throw InputError(
        fmt::format("{}: expected segments of shape (N, 4) [x1 y1 x2 y2], (N, 5) with "
                    "a score, or (N, 2, 2) [[x1 y1] [x2 y2]], found {}",
                    stored.place, array.ShapeText()));
  }
  const std::vector<double> values = array.Values<double>();
  for (size_t i = 0; i < array.shape[0]; ++i) {
    const double* row = values.data() + i * columns;
    for (uint64_t k = 0; k < columns; ++k) {
      if (!std::isfinite(row[k])) {
        throw InputError(
            fmt::format("{}: segment {} has the number {}, expected finite ones; "
                        "remove such segments before you save them",
                        stored.place, i, row[k]));
      }
    }
    raw->segments.push_back({{row[0], row[1]}, {row[2], row[3]}});
    if (columns == 5) raw->scores.push_back(static_cast<float>(row[4]));
  }
}

void TakeDescriptors(const StoredArray& stored, RawSegments* raw) {
  const std::vector<uint64_t>& shape = stored.array.shape;
  const size_t n = raw->segments.size();
  if (n == 0) return;
  const bool by_row = shape.size() == 2 && shape[0] == n;
  const bool by_column = shape.size() == 2 && shape[1] == n;  // as hloc's
  if (!by_row && !by_column) {
    throw InputError(
        fmt::format("{}: expected descriptors of shape ({}, D) or (D, {}) as there "
                    "are {} segments, found {}",
                    stored.place, n, n, n, stored.array.ShapeText()));
  }
  // (72, 72) is read by rows.
  raw->descriptor_size = by_row ? shape[1] : shape[0];
  std::vector<float> values = stored.array.Values<float>();
  for (const float value : values) {
    if (!std::isfinite(value)) {
      throw InputError(stored.place +
                       ": a descriptor has a number that is not finite; remove its segment");
    }
  }
  if (by_row) {
    raw->descriptors = std::move(values);
    return;
  }
  raw->descriptors.resize(values.size());
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < raw->descriptor_size; ++k) {
      raw->descriptors[i * raw->descriptor_size + k] = values[k * n + i];
    }
  }
}

PixelCentre ToPixelCentre(double value, const std::string& place) {
  if (value == 0.0) return PixelCentre::kZero;
  if (value == 0.5) return PixelCentre::kHalf;
  throw InputError(fmt::format("{}: expected 0 or 0.5 as the centre of the first pixel, found {}",
                               place, value));
}

Eigen::Vector2d ToImageSize(double width, double height, const std::string& place) {
  if (!(width >= 1.0) || !(height >= 1.0) || !(width < 1e9) || !(height < 1e9)) {
    throw InputError(
        fmt::format("{}: expected the width and height of the image in pixels, found "
                    "{} and {}",
                    place, width, height));
  }
  return {width, height};
}

// The arrays of one image by their last names.
using ImageArrays = std::map<std::string, const StoredArray*, std::less<>>;

// Empty: there are no segments among them.
std::optional<RawSegments> FromArrays(const ImageArrays& arrays) {
  RawSegments raw;
  bool found = false;
  for (const std::string_view key : kSegmentKeys) {
    const auto it = arrays.find(key);
    if (it == arrays.end()) continue;
    // Keypoints that are points say nothing about lines.
    if (key == "keypoints" && NumColumns(it->second->array) == 0) continue;
    TakeSegments(*it->second, &raw);
    found = true;
    break;
  }
  if (!found) return std::nullopt;
  for (const std::string_view key : kSegmentScoreKeys) {
    const auto it = arrays.find(key);
    if (it == arrays.end()) continue;
    // With lines of their own, "scores" may be those of points.
    if (it->second->array.size() != raw.segments.size()) continue;
    raw.scores = it->second->array.Values<float>();
    break;
  }
  for (const std::string_view key : kDescriptorKeys) {
    const auto it = arrays.find(key);
    if (it == arrays.end()) continue;
    if (key == "descriptors" && arrays.contains("keypoints") && arrays.contains("lines")) continue;
    TakeDescriptors(*it->second, &raw);
    break;
  }
  if (const auto it = arrays.find(kPixelCentreKey); it != arrays.end()) {
    if (it->second->array.size() != 1) {
      throw InputError(it->second->place + ": expected one number, 0 or 0.5, found " +
                       it->second->array.ShapeText());
    }
    raw.pixel_centre = ToPixelCentre(it->second->array.Values<double>()[0], it->second->place);
  }
  if (const auto it = arrays.find(kImageSizeKey); it != arrays.end()) {
    if (it->second->array.size() != 2) {
      throw InputError(it->second->place + ": expected two numbers, width and height, found " +
                       it->second->array.ShapeText());
    }
    const std::vector<double> size = it->second->array.Values<double>();
    raw.image_size = ToImageSize(size[0], size[1], it->second->place);
  }
  return raw;
}

bool IsText(const fs::path& path) { return path.extension() == ".txt"; }

void Merge(std::map<std::string, RawSegments>* all, std::map<std::string, RawSegments> more) {
  for (auto& [name, raw] : more) {
    const std::string place = raw.place;
    if (const auto [it, is_new] = all->emplace(name, std::move(raw)); !is_new) {
      throw InputError(place + ": the segments of '" + name +
                       "' are there twice; remove them here or in " + it->second.place);
    }
  }
}

std::map<std::string, RawSegments> ReadSegmentArrays(const fs::path& path) {
  const StoredArrays stored = ReadStoredArrays(path, [&](std::string_view array_path) {
    // In an archive or a folder an array may be named by its image alone.
    return IsKey(SplitLast(array_path).second) || !HasHdf5Extension(path);
  });
  std::map<std::string, ImageArrays> by_image;
  std::map<std::string, RawSegments> all;
  for (const auto& [array_path, array] : stored) {
    const auto [image_name, key] = SplitLast(array_path);
    if (IsKey(key)) {
      by_image[std::string(image_name)].emplace(key, &array);
    } else if (NumColumns(array.array) != 0 || HasNoRows(array.array)) {
      RawSegments raw;
      TakeSegments(array, &raw);
      Merge(&all, {{array_path, std::move(raw)}});
    }
  }
  for (const auto& [image_name, arrays] : by_image) {
    // An archive of one image beside others has no name in it: the archive's.
    const std::string name = image_name.empty() ? path.stem().string() : image_name;
    if (auto raw = FromArrays(arrays)) Merge(&all, {{name, std::move(*raw)}});
  }
  if (all.empty() && !fs::is_directory(path)) {
    throw InputError(path,
                     "expected arrays named IMAGE_NAME/lines (or segments) of shape (N, 4), (N, 5) "
                     "or (N, 2, 2), found no segments");
  }
  return all;
}

}  // namespace

void SegmentImportOptions::Describe(OptionTable* table) const {
  table->Section("SegmentImport");
  table->Choice(
      "pixel_centre", &pixel_centre,
      {{"auto", PixelCentre::kByFormat}, {"0", PixelCentre::kZero}, {"0.5", PixelCentre::kHalf}},
      "Where imported coordinates have the centre of the top-left pixel; auto: 0.5 in "
      "text, 0 in npz and HDF5, or as the file says.");
  table->Field("max_outside_px", &max_outside_px, AtLeast(0),
               "How far an imported segment may reach out of its image.");
}

std::map<std::string, RawSegments> ParseSegmentText(std::string_view bytes, const fs::path& path,
                                                    const std::string& image_name) {
  std::map<std::string, RawSegments> all;
  ImportLines lines(bytes, path);
  RawSegments* current = nullptr;
  size_t columns = 0;  // of the current image
  std::optional<PixelCentre> pixel_centre;
  std::optional<Eigen::Vector2d> image_size;
  std::optional<uint64_t> announced;  // LIMAP's files begin with the number of segments
  const auto begin_image = [&](const std::string& name) {
    RawSegments raw;
    raw.is_text = true;
    raw.place = lines.Place();
    raw.pixel_centre = pixel_centre;
    raw.image_size = image_size;
    const auto [it, is_new] = all.emplace(name, std::move(raw));
    if (!is_new)
      lines.Fail("the segments of '" + name + "' are there twice; remove them here or above");
    current = &it->second;
    columns = 0;
  };
  bool first_record = true;
  while (const std::optional<std::string_view> line = lines.Next()) {
    if (line->empty()) continue;
    const std::vector<std::string_view> words = ImportLines::Words(*line);
    const bool is_first = first_record;
    first_record = false;
    if (words[0] == "IMAGE") {
      if (words.size() < 2) lines.Fail("expected IMAGE NAME, found no name");
      std::string_view name = line->substr(words[0].size());
      name.remove_prefix(static_cast<size_t>(words[1].data() - name.data()));
      begin_image(std::string(name));
    } else if (words[0] == "PIXEL_CENTRE") {
      const auto value = words.size() == 2 ? ImportLines::Real(words[1]) : std::nullopt;
      if (!value) lines.Fail("expected PIXEL_CENTRE 0 or PIXEL_CENTRE 0.5");
      pixel_centre = ToPixelCentre(*value, lines.Place());
      if (current != nullptr) current->pixel_centre = pixel_centre;
    } else if (words[0] == "SIZE") {
      const auto width = words.size() == 3 ? ImportLines::Real(words[1]) : std::nullopt;
      const auto height = words.size() == 3 ? ImportLines::Real(words[2]) : std::nullopt;
      if (!width || !height) lines.Fail("expected SIZE WIDTH HEIGHT");
      image_size = ToImageSize(*width, *height, lines.Place());
      if (current != nullptr) current->image_size = image_size;
    } else if (is_first && words.size() == 1 && ImportLines::Number(words[0])) {
      announced = ImportLines::Number(words[0]);
    } else {
      if (words.size() != 4 && words.size() != 5) {
        lines.Fail(fmt::format("expected X1 Y1 X2 Y2 [SCORE], found {} words: '{}'", words.size(),
                               ImportLines::Shown(*line)));
      }
      double values[5] = {};
      for (size_t i = 0; i < words.size(); ++i) {
        const std::optional<double> value = ImportLines::Real(words[i]);
        if (!value) {
          constexpr const char* kFields[] = {"X1", "Y1", "X2", "Y2", "SCORE"};
          lines.Fail(fmt::format("expected {} (a finite number), found '{}'", kFields[i],
                                 ImportLines::Shown(words[i])));
        }
        values[i] = *value;
      }
      if (current == nullptr) begin_image(image_name);
      if (columns == 0) columns = words.size();
      if (columns != words.size()) {
        lines.Fail("expected a SCORE for all segments of an image or for none");
      }
      current->segments.push_back({{values[0], values[1]}, {values[2], values[3]}});
      if (columns == 5) current->scores.push_back(static_cast<float>(values[4]));
    }
  }
  if (all.empty()) begin_image(image_name);  // an image without segments
  if (announced && (all.size() != 1 || *announced != current->segments.size())) {
    lines.Fail(fmt::format("expected as many segments as the first line says, {}, found {}",
                           *announced, current->segments.size()));
  }
  return all;
}

std::map<std::string, RawSegments> ReadSegments(const fs::path& path) {
  if (!fs::exists(path)) throw NoSuchFileOrFolder(path);
  std::map<std::string, RawSegments> all;
  if (fs::is_directory(path)) {
    for (const auto& [name, file] : FilesBelow(path)) {
      if (!IsText(file)) continue;
      Merge(&all, ParseSegmentText(ReadFileBytes(file), file, std::string(WithoutExtension(name))));
    }
    Merge(&all, ReadSegmentArrays(path));
    if (all.empty()) {
      throw InputError(
          path,
          "expected files IMAGE_NAME.txt, .npz or .npy of segments in this folder, found none");
    }
  } else if (IsText(path)) {
    all = ParseSegmentText(ReadFileBytes(path), path, path.stem().string());
  } else if (HoldsArrays(path)) {
    all = ReadSegmentArrays(path);
  } else {
    throw InputError(path,
                     "expected a folder, or a file that ends in .txt, .npz, .npy, .h5 or .hdf5");
  }
  return all;
}

std::map<image_t, ImportedSegments> ImportSegments(const fs::path& path,
                                                   const Reconstruction& model,
                                                   const SegmentImportOptions& options,
                                                   SegmentImportReport* report) {
  std::map<image_t, ImportedSegments> result;
  std::map<image_t, std::string> name_of;
  std::string unknown;
  size_t num_unused_lists = 0, unused_size = 0;
  const std::map<std::string, RawSegments> all = ReadSegments(path);
  ImageNames names(model);
  std::vector<std::string> names_of_file;
  for (const auto& [name, raw] : all) names_of_file.push_back(name);
  names.Learn(names_of_file);
  for (const auto& [name, raw] : all) {
    const std::optional<image_t> image_id = names.Find(name);
    if (!image_id) {
      if (report->num_unknown_names++ == 0) unknown = name;
      continue;
    }
    if (const auto [it, is_new] = name_of.emplace(*image_id, name); !is_new) {
      throw InputError(raw.place + ": '" + name + "' and '" + it->second +
                       "' are the same image; remove one");
    }
    const Image& image = model.images.at(*image_id);
    const Camera& camera = model.cameras.at(image.camera_id);
    const Eigen::Vector2d size(static_cast<double>(camera.width),
                               static_cast<double>(camera.height));
    PixelCentre centre = options.pixel_centre;
    if (raw.pixel_centre) centre = *raw.pixel_centre;
    if (centre == PixelCentre::kByFormat) {
      centre = raw.is_text ? PixelCentre::kHalf : PixelCentre::kZero;
    }
    const double shift = centre == PixelCentre::kZero ? 0.5 : 0.0;
    const Eigen::Vector2d scale = raw.image_size
                                      ? Eigen::Vector2d(size.cwiseQuotient(*raw.image_size))
                                      : Eigen::Vector2d::Ones();
    const bool is_ours = raw.descriptor_size == kSegmentDescriptorSize;
    if (raw.descriptor_size != 0 && !is_ours) {
      report->num_unused_descriptors += raw.segments.size();
      ++num_unused_lists;
      unused_size = raw.descriptor_size;
    }
    ImportedSegments& imported = result[*image_id];
    for (size_t i = 0; i < raw.segments.size(); ++i) {
      const auto to_pixel = [&](const Eigen::Vector2d& x) -> Eigen::Vector2d {
        return (x.array() + shift) * scale.array();
      };
      const LineSegment2d segment{to_pixel(raw.segments[i].start), to_pixel(raw.segments[i].end)};
      for (const Eigen::Vector2d& x : {segment.start, segment.end}) {
        const double outside = std::max((-x).maxCoeff(), (x - size).maxCoeff());
        if (outside > options.max_outside_px) {
          throw InputError(fmt::format(
              "{}: segment {} of '{}' ends at ({:.1f}, {:.1f}), {:.1f} px outside of the image, "
              "which is {} x {}; give the size of the image that the detector worked on, if it was "
              "resized (SIZE in text, image_size in npz and HDF5)",
              raw.place, i, image.name, x.x(), x.y(), outside, camera.width, camera.height));
        }
      }
      // Shorter ones have no direction.
      constexpr double kMinLengthPx = 1e-3;
      if (!(segment.Length() >= kMinLengthPx)) {
        ++report->dropped["no length"];
        imported.idx_of_row.push_back(kInvalidId32);
        continue;
      }
      imported.idx_of_row.push_back(static_cast<line2D_t>(imported.segments.size()));
      imported.segments.push_back(segment);
      if (!raw.scores.empty()) imported.scores.push_back(raw.scores[i]);
      if (is_ours) {
        const Eigen::Map<const Eigen::VectorXf> descriptor(
            raw.descriptors.data() + i * kSegmentDescriptorSize, kSegmentDescriptorSize);
        const float norm = descriptor.norm();
        if (!(norm > 0.0f) || !std::isfinite(norm)) {
          throw InputError(fmt::format(
              "{}: expected a finite descriptor other than 0 of segment {}, found one of norm {}",
              raw.place, i, norm));
        }
        for (const float value : descriptor) imported.descriptors.push_back(value / norm);
      }
    }
    report->num_segments += imported.segments.size();
  }
  report->num_images = result.size();
  report->num_images_without = model.images.size() - result.size();
  if (result.empty() && report->num_unknown_names > 0) {
    throw names.NothingKnown(path, report->num_unknown_names, "image", unknown);
  }
  if (report->num_unknown_names > 0) {
    ImageNames::WarnOfUnknown(path, report->num_unknown_names, all.size(), "image", unknown);
  }
  if (num_unused_lists > 0) {
    LogWarning(
        "{}: the descriptors of {} have {} values, not the {} of holba's own, and are not used; "
        "import the matches of their matcher, too",
        path.string(), Counted(num_unused_lists, "image"), unused_size, kSegmentDescriptorSize);
  }
  return result;
}

}  // namespace holba
