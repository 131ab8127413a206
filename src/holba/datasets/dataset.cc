// SPDX-License-Identifier: BSD-3-Clause
#include "holba/datasets/dataset.h"

#include <algorithm>
#include <cctype>

namespace holba {

#define HOLBA_DATASET(function, name, key, summary) \
  Dataset Read##function(const std::filesystem::path& folder, const DatasetOptions& options);
#include "holba/datasets/list.inc"
#undef HOLBA_DATASET

namespace {

// "ScanNet++" -> "scannetpp", "TUM RGB-D" -> "tumrgbd".
std::string Letters(std::string_view name) {
  std::string letters;
  for (const char c : name) {
    if (c == '+') letters += 'p';
    if (std::isalnum(static_cast<unsigned char>(c)))
      letters += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return letters;
}

}  // namespace

void DatasetOptions::Describe(OptionTable* table) const {
  table->Field("part", &part,
               "Part of the set, where it has several (ETH3D and ScanNet++: dslr, rig, iphone; "
               "Hypersim: cam_00; 7Scenes: seq-01, train or test).");
  table->Field("stride", &stride, AtLeast(1),
               "Take every stride-th image (of a rig: every stride-th instant).");
}

std::vector<DatasetFormat> AllDatasetFormats() {
  return {
#define HOLBA_DATASET(function, name, key, summary) {name, key, summary, Read##function},
#include "holba/datasets/list.inc"
#undef HOLBA_DATASET
  };
}

std::optional<DatasetFormat> FindDatasetFormat(std::string_view name) {
  for (const DatasetFormat& format : AllDatasetFormats()) {
    if (Letters(name) == Letters(format.key) || Letters(name) == Letters(format.name))
      return format;
  }
  return std::nullopt;
}

}  // namespace holba
