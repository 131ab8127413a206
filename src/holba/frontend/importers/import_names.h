// SPDX-License-Identifier: BSD-3-Clause
// Which image of a model a name in another program's files means.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "holba/base/error.h"
#include "holba/scene/name_pairing.h"
#include "holba/scene/reconstruction.h"

namespace holba {

class ImageNames {
 public:
  // Throws InputError if two images of the model have one name.
  explicit ImageNames(const Reconstruction& model);

  // Names of a file that are not the model's are paired with images that none of them means, by the
  // ends of their paths (scene/name_pairing.h): Find and FindPair know them from then on. Says on
  // the log what was paired how. A '-' of a name without '/' may stand for '/', as hloc has it.
  void Learn(std::span<const std::string> names);
  // As Learn, for the names in "NAME1/NAME2" (text: "NAME1 NAME2"), where there is one way to cut
  // it.
  void LearnFromPairs(std::span<const std::string> pairs, bool is_text);

  // The image whose name it is; else the one image whose name it is without the extension; else
  // LIMAP's "segments_ID". Empty: none, or several without the extension.
  std::optional<image_t> Find(std::string_view name) const;
  // The two images of "NAME1/NAME2", where hloc writes '-' for each '/' inside the names (older
  // versions: "NAME1_NAME2"), or names are as they are. Empty: none. Throws InputError if several
  // pairs are written so; `place` says where.
  std::optional<std::pair<image_t, image_t>> FindPair(std::string_view text,
                                                      const std::string& place) const;
  // The two images of "NAME1 NAME2"; names may contain blanks.
  std::optional<std::pair<image_t, image_t>> FindPairOfWords(std::string_view text) const;

  // What to say of `num_unknown` of a file's `num_all` things ("image", "pair") whose names are not
  // in the model, as `example` is not: nothing is known, or a part is left out.
  InputError NothingKnown(const std::filesystem::path& path, size_t num_all, std::string_view thing,
                          std::string_view example) const;
  static void WarnOfUnknown(const std::filesystem::path& path, size_t num_unknown, size_t num_all,
                            std::string_view thing, std::string_view example);

 private:
  // Of the model's names and those that were learnt.
  std::optional<image_t> FindWhole(std::string_view name) const;
  // The one image whose name it is with '-' for each '/'.
  std::optional<image_t> FindDashed(std::string_view name) const;

  std::map<std::string, image_t, std::less<>> by_name_;
  std::map<std::string, std::set<image_t>, std::less<>> by_stem_;
  std::map<std::string, std::set<image_t>, std::less<>> by_dashed_name_;

  std::map<image_t, std::string> name_of_;
  std::map<std::string, image_t, std::less<>> learnt_;
  std::set<image_t> ids_;
  std::string example_;
};

}  // namespace holba
