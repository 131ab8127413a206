// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_names.h"

#include <algorithm>
#include <charconv>

#include "holba/base/error.h"

namespace holba {

ImageNames::ImageNames(const Reconstruction& model) {
  for (const auto& [image_id, image] : model.images) {
    if (!by_name_.emplace(image.name, image_id).second) {
      throw InputError("two images of the model are named '" + image.name +
                       "': what is imported by name cannot be told apart");
    }
    by_stem_[std::string(WithoutExtension(image.name))].insert(image_id);
    std::string dashed = image.name;
    std::replace(dashed.begin(), dashed.end(), '/', '-');
    by_dashed_name_[dashed].insert(image_id);
    ids_.insert(image_id);
    if (example_.empty()) example_ = image.name;
  }
}

std::optional<image_t> ImageNames::Find(std::string_view name) const {
  if (const auto it = by_name_.find(name); it != by_name_.end()) return it->second;
  if (const auto it = by_stem_.find(name); it != by_stem_.end()) {
    if (it->second.size() == 1) return *it->second.begin();
    return std::nullopt;
  }
  constexpr std::string_view kLimap = "segments_";
  if (name.starts_with(kLimap)) {
    image_t image_id;
    const char* end_of_name = name.data() + name.size();
    const auto [end, error] = std::from_chars(name.data() + kLimap.size(), end_of_name, image_id);
    if (error == std::errc() && end == end_of_name && ids_.contains(image_id)) return image_id;
  }
  return std::nullopt;
}

std::optional<std::pair<image_t, image_t>> ImageNames::FindPair(std::string_view text,
                                                                const std::string& place) const {
  std::set<std::pair<image_t, image_t>> found;
  for (const auto* names : {&by_dashed_name_, &by_stem_}) {
    for (size_t at = 0; at < text.size(); ++at) {
      if (text[at] != '/' && text[at] != '_') continue;
      const auto first = names->find(text.substr(0, at));
      if (first == names->end()) continue;
      const auto second = names->find(text.substr(at + 1));
      if (second == names->end()) continue;
      for (const image_t id1 : first->second) {
        for (const image_t id2 : second->second) {
          if (id1 != id2) found.emplace(id1, id2);
        }
      }
    }
    if (!found.empty()) break;
  }
  if (found.empty()) {
    for (size_t at = text.find('/'); at != std::string_view::npos; at = text.find('/', at + 1)) {
      const auto first = by_name_.find(text.substr(0, at));
      const auto second = by_name_.find(text.substr(at + 1));
      if (first != by_name_.end() && second != by_name_.end() && first->second != second->second) {
        found.emplace(first->second, second->second);
      }
    }
  }
  if (found.size() > 1) {
    throw InputError(place + ": '" + std::string(text) +
                     "' may mean several pairs of images of the model; give the matches as text "
                     "(docs: Importing features)");
  }
  if (found.empty()) return std::nullopt;
  return *found.begin();
}

std::optional<std::pair<image_t, image_t>> ImageNames::FindPairOfWords(
    std::string_view text) const {
  for (size_t at = 0; at < text.size(); ++at) {
    if (text[at] != ' ' && text[at] != '\t') continue;
    size_t next = at;
    while (next < text.size() && (text[next] == ' ' || text[next] == '\t')) ++next;
    const std::optional<image_t> first = Find(text.substr(0, at));
    const std::optional<image_t> second = Find(text.substr(next));
    if (first && second && *first != *second) return std::make_pair(*first, *second);
  }
  return std::nullopt;
}

}  // namespace holba
