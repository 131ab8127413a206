// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <vector>

#include "holba/base/log.h"
#include "holba/base/words.h"

namespace holba {

ImageNames::ImageNames(const Reconstruction& model) {
  for (const auto& [image_id, image] : model.images) {
    if (!by_name_.emplace(image.name, image_id).second) {
      throw InputError(
          "two images of the model have the same name '" + image.name +
          "', so that what is imported by name cannot be told apart; give one of them another");
    }
    by_stem_[std::string(WithoutExtension(image.name))].insert(image_id);
    std::string dashed = image.name;
    std::replace(dashed.begin(), dashed.end(), '/', '-');
    by_dashed_name_[dashed].insert(image_id);
    ids_.insert(image_id);
    name_of_.emplace(image_id, image.name);
    if (example_.empty()) example_ = image.name;
  }
}

void ImageNames::Learn(std::span<const std::string> names) {
  std::set<std::string> unknown;
  std::set<image_t> meant;
  for (const std::string& name : names) {
    std::optional<image_t> image_id = Find(name);
    if (!image_id) image_id = FindDashed(name);
    if (image_id) {
      meant.insert(*image_id);
    } else {
      unknown.insert(name);
    }
  }
  const size_t num_whole = meant.size();
  size_t num_by_ending = 0;
  std::string examples;
  // Pairs what is left on both sides, first by the names as they are, then with '/' for each '-' of
  // those without '/' and of the model's names.
  for (const bool is_dashed : {false, true}) {
    std::vector<std::string> own, others;
    std::vector<std::string_view> as_written;
    std::vector<image_t> ids;
    const auto slashed = [is_dashed](std::string name) {
      if (is_dashed) std::replace(name.begin(), name.end(), '-', '/');
      return name;
    };
    for (const std::string& name : unknown) {
      if (is_dashed && (name.find('/') != name.npos || name.find('-') == name.npos)) continue;
      as_written.push_back(name);
      own.push_back(slashed(name));
    }
    if (own.empty()) continue;
    for (const auto& [image_id, name] : name_of_) {
      if (meant.contains(image_id)) continue;
      ids.push_back(image_id);
      others.push_back(slashed(name));
    }
    const std::vector<std::string_view> a(own.begin(), own.end()), b(others.begin(), others.end());
    const NamePairing pairing = PairNames(a, b);
    std::vector<std::string> paired;
    for (size_t i = 0; i < own.size(); ++i) {
      if (!pairing.b_of_a[i]) continue;
      const image_t image_id = ids[*pairing.b_of_a[i]];
      learnt_.emplace(as_written[i], image_id);
      meant.insert(image_id);
      paired.emplace_back(as_written[i]);
    }
    for (const std::string& name : paired) unknown.erase(name);
    num_by_ending += pairing.NumPairs();
    if (!pairing.examples.empty()) examples += (examples.empty() ? "" : ", ") + pairing.examples;
  }
  if (num_by_ending > 0)
    LogInfo("{}", HowPaired("imported name", num_whole, num_by_ending, examples));
}

void ImageNames::LearnFromPairs(std::span<const std::string> pairs, bool is_text) {
  std::set<std::string> names;
  for (const std::string& pair : pairs) {
    const size_t at = pair.find_first_of(is_text ? " \t" : "/");
    if (at == std::string::npos || at != pair.find_last_of(is_text ? " \t" : "/")) continue;
    names.insert(pair.substr(0, at));
    names.insert(pair.substr(at + 1));
  }
  Learn(std::vector<std::string>(names.begin(), names.end()));
}

std::optional<image_t> ImageNames::FindWhole(std::string_view name) const {
  if (const auto it = by_name_.find(name); it != by_name_.end()) return it->second;
  if (const auto it = learnt_.find(name); it != learnt_.end()) return it->second;
  return std::nullopt;
}

std::optional<image_t> ImageNames::FindDashed(std::string_view name) const {
  const auto it = by_dashed_name_.find(name);
  if (it == by_dashed_name_.end() || it->second.size() != 1) return std::nullopt;
  return *it->second.begin();
}

std::optional<image_t> ImageNames::Find(std::string_view name) const {
  if (const std::optional<image_t> whole = FindWhole(name)) return whole;
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
    const auto find = [this](std::string_view name) {
      const std::optional<image_t> whole = FindWhole(name);
      return whole ? whole : FindDashed(name);
    };
    for (size_t at = text.find('/'); at != std::string_view::npos; at = text.find('/', at + 1)) {
      const std::optional<image_t> first = find(text.substr(0, at));
      const std::optional<image_t> second = find(text.substr(at + 1));
      if (first && second && *first != *second) found.emplace(*first, *second);
    }
  }
  if (found.size() > 1) {
    throw InputError(place + ": '" + std::string(text) +
                     "' may mean several pairs of images of the model; give the matches as text "
                     "(docs/import.md)");
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

InputError ImageNames::NothingKnown(const std::filesystem::path& path, size_t num_all,
                                    std::string_view thing, std::string_view example) const {
  constexpr size_t kMaxShown = 60;
  return InputError(path,
                    fmt::format("none of its names ({}) is in the model; expected names like "
                                "'{}', found '{}'",
                                Counted(num_all, thing), example_, example.substr(0, kMaxShown)));
}

void ImageNames::WarnOfUnknown(const std::filesystem::path& path, size_t num_unknown,
                               size_t num_all, std::string_view thing, std::string_view example) {
  LogWarning("{}: {} of {} {} not in the model and left out, for example '{}'", path.string(),
             num_unknown, Counted(num_all, thing), Agree(num_unknown, "is", "are"), example);
}

}  // namespace holba
