// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/name_pairing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "holba/base/words.h"

namespace holba {
namespace {

std::string LowerCase(std::string text) {
  // Bytes beyond ASCII stay: their case depends on an encoding that is not known.
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

struct Path {
  // From the last to the first, the last without its extension.
  std::vector<std::string> components, lower_case;
  std::string extension;
};

// Numbers after a dot are no extension: names may be times.
bool IsExtension(std::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](unsigned char c) { return std::isalpha(c) != 0; });
}

Path Split(std::string_view name) {
  Path path;
  std::string text(name);
  std::replace(text.begin(), text.end(), '\\', '/');
  std::string_view stem = WithoutExtension(text);
  path.extension = text.substr(stem.size());
  if (!IsExtension(path.extension)) stem = text;
  for (size_t end = stem.size(), begin; end != std::string_view::npos; end = begin) {
    begin = end == 0 ? std::string_view::npos : stem.rfind('/', end - 1);
    const size_t first = begin == std::string_view::npos ? 0 : begin + 1;
    const std::string component(stem.substr(first, end - first));
    if (component.empty() || component == ".") continue;
    path.components.push_back(component);
    path.lower_case.push_back(LowerCase(component));
  }
  return path;
}

// How well two paths fit: components shared, whether their case agrees, whether the extensions do.
using Fit = std::tuple<size_t, bool, bool>;

struct Candidate {
  Fit fit{0, false, false};
  std::optional<size_t> index;
  bool is_ambiguous = false;

  void Consider(const Fit& other_fit, size_t other) {
    if (index && other_fit < fit) return;
    is_ambiguous = index && other_fit == fit;
    index = other;
    fit = other_fit;
  }
};

class Pairing {
 public:
  Pairing(std::span<const std::string_view> a, std::span<const std::string_view> b)
      : a_(a), b_(b) {}

  NamePairing Run() {
    PairWholeNames();
    if (pairing_.num_whole < std::min(a_.size(), b_.size())) PairByEndings();
    for (size_t i = 0; i < a_.size() && !pairing_.unpaired_a; ++i) {
      if (!pairing_.b_of_a[i]) pairing_.unpaired_a = i;
    }
    for (size_t j = 0; j < b_.size() && !pairing_.unpaired_b; ++j) {
      if (!b_is_paired_[j]) pairing_.unpaired_b = j;
    }
    return std::move(pairing_);
  }

 private:
  void PairWholeNames() {
    pairing_.b_of_a.resize(a_.size());
    b_is_paired_.resize(b_.size());
    std::unordered_map<std::string_view, size_t> b_of_name;
    for (size_t j = 0; j < b_.size(); ++j) b_of_name.emplace(b_[j], j);
    for (size_t i = 0; i < a_.size(); ++i) {
      const auto found = b_of_name.find(a_[i]);
      if (found == b_of_name.end() || b_is_paired_[found->second]) continue;
      Join(i, found->second);
      ++pairing_.num_whole;
    }
  }

  void PairByEndings() {
    std::vector<Path> paths_a, paths_b;
    std::set<std::string, std::less<>> folders_a, folders_b;
    const auto split = [](std::span<const std::string_view> names, std::vector<Path>* paths,
                          std::set<std::string, std::less<>>* folders) {
      for (const std::string_view name : names) {
        paths->push_back(Split(name));
        const std::vector<std::string>& components = paths->back().lower_case;
        for (size_t k = 1; k < components.size(); ++k) folders->insert(components[k]);
      }
    };
    split(a_, &paths_a, &folders_a);
    split(b_, &paths_b, &folders_b);
    std::map<std::string, std::vector<size_t>, std::less<>> b_of_stem;
    for (size_t j = 0; j < b_.size(); ++j) {
      if (!b_is_paired_[j] && !paths_b[j].components.empty())
        b_of_stem[paths_b[j].lower_case[0]].push_back(j);
    }
    std::vector<Candidate> best_of_a(a_.size()), best_of_b(b_.size());
    for (size_t i = 0; i < a_.size(); ++i) {
      if (pairing_.b_of_a[i] || paths_a[i].components.empty()) continue;
      const auto of_stem = b_of_stem.find(paths_a[i].lower_case[0]);
      if (of_stem == b_of_stem.end()) continue;
      for (const size_t j : of_stem->second) {
        const std::optional<Fit> fit = FitOf(paths_a[i], paths_b[j], folders_a, folders_b);
        if (!fit) continue;
        best_of_a[i].Consider(*fit, j);
        best_of_b[j].Consider(*fit, i);
      }
    }
    std::set<std::string> ways;
    for (size_t i = 0; i < a_.size(); ++i) {
      const Candidate& best = best_of_a[i];
      if (!best.index) continue;
      const Candidate& back = best_of_b[*best.index];
      if (best.is_ambiguous || (back.is_ambiguous && back.fit == best.fit)) {
        ++pairing_.num_ambiguous;
      } else if (back.index == i) {
        Join(i, *best.index);
        ++pairing_.num_by_ending;
        AddExample(i, paths_a[i], paths_b[*best.index], best.fit, &ways);
      }
    }
  }

  // Empty: they are of different images.
  static std::optional<Fit> FitOf(const Path& a, const Path& b,
                                  const std::set<std::string, std::less<>>& folders_a,
                                  const std::set<std::string, std::less<>>& folders_b) {
    size_t shared = 0;
    bool same_case = true;
    const size_t most = std::min(a.components.size(), b.components.size());
    for (; shared < most && a.lower_case[shared] == b.lower_case[shared]; ++shared)
      same_case = same_case && a.components[shared] == b.components[shared];
    if (shared < most &&
        (folders_b.contains(a.lower_case[shared]) || folders_a.contains(b.lower_case[shared]))) {
      return std::nullopt;
    }
    return Fit{shared, same_case, a.extension == b.extension};
  }

  void AddExample(size_t i, const Path& a, const Path& b, const Fit& fit,
                  std::set<std::string>* ways) {
    const auto& [shared, same_case, same_extension] = fit;
    std::string way = std::string(same_case ? "" : "c") + (same_extension ? "" : "e");
    if (shared < a.components.size() || shared < b.components.size()) way += "f";
    constexpr size_t kMostExamples = 3;
    if (!ways->insert(way).second || ways->size() > kMostExamples) return;
    if (!pairing_.examples.empty()) pairing_.examples += ", ";
    pairing_.examples +=
        "'" + std::string(a_[i]) + "' is '" + std::string(b_[*pairing_.b_of_a[i]]) + "'";
  }

  void Join(size_t i, size_t j) {
    pairing_.b_of_a[i] = j;
    b_is_paired_[j] = true;
  }

  std::span<const std::string_view> a_, b_;
  NamePairing pairing_;
  std::vector<bool> b_is_paired_;
};

}  // namespace

std::string_view WithoutExtension(std::string_view name) {
  const size_t dot = name.rfind('.');
  const size_t slash = name.rfind('/');
  const size_t first = slash == std::string_view::npos ? 0 : slash + 1;
  return dot == std::string_view::npos || dot <= first ? name : name.substr(0, dot);
}

NamePairing PairNames(std::span<const std::string_view> a, std::span<const std::string_view> b) {
  return Pairing(a, b).Run();
}

std::string HowPaired(std::string_view thing, size_t num_whole, size_t num_by_ending,
                      std::string_view examples) {
  return fmt::format(
      "Paired {} by {} and {} by the ends of their paths: {}", Counted(num_whole, thing),
      Agree(num_whole, "its whole name", "their whole names"), num_by_ending, examples);
}

}  // namespace holba
