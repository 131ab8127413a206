// SPDX-License-Identifier: BSD-3-Clause
// Which image of a model a name in another program's files means.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "holba/scene/name_pairing.h"
#include "holba/scene/reconstruction.h"

namespace holba {

class ImageNames {
 public:
  // Throws InputError if two images of the model have one name.
  explicit ImageNames(const Reconstruction& model);

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

  // A name of the model, for messages.
  const std::string& Example() const { return example_; }

 private:
  std::map<std::string, image_t, std::less<>> by_name_;
  std::map<std::string, std::set<image_t>, std::less<>> by_stem_;
  std::map<std::string, std::set<image_t>, std::less<>> by_dashed_name_;
  std::set<image_t> ids_;
  std::string example_;
};

}  // namespace holba
