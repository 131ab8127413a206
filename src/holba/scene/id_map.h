// SPDX-License-Identifier: BSD-3-Clause
// Records by id, kept in the order in which they came (files are written in the order they were read).
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "holba/base/check.h"

namespace holba {

template <typename Id, typename T>
class IdMap {
 public:
  using Entry = std::pair<Id, T>;

  size_t size() const { return entries_.size(); }
  bool empty() const { return entries_.empty(); }
  bool contains(Id id) const { return index_.contains(id); }
  auto begin() { return entries_.begin(); }
  auto end() { return entries_.end(); }
  auto begin() const { return entries_.begin(); }
  auto end() const { return entries_.end(); }

  // Null: no such id.
  T* Find(Id id) {
    const auto it = index_.find(id);
    return it == index_.end() ? nullptr : &entries_[it->second].second;
  }
  const T* Find(Id id) const { return const_cast<IdMap*>(this)->Find(id); }
  T& at(Id id) {
    T* value = Find(id);
    HOLBA_CHECK_MSG(value != nullptr, "no id " + std::to_string(id));
    return *value;
  }
  const T& at(Id id) const { return const_cast<IdMap*>(this)->at(id); }
  // Position of an id in iteration order; the id must be there.
  size_t IndexOf(Id id) const {
    const auto it = index_.find(id);
    HOLBA_CHECK_MSG(it != index_.end(), "no id " + std::to_string(id));
    return it->second;
  }

  // False: the id is there already, nothing was added. References into the map end here.
  bool Add(Id id, T value) {
    if (!index_.emplace(id, entries_.size()).second) return false;
    entries_.emplace_back(id, std::move(value));
    return true;
  }
  // Removes all whose id satisfies `predicate(id, value)`; the order of the others stays.
  template <typename Predicate>
  size_t RemoveIf(Predicate predicate) {
    const size_t before = entries_.size();
    std::erase_if(entries_, [&](const Entry& e) { return predicate(e.first, e.second); });
    if (entries_.size() != before) {
      index_.clear();
      for (size_t i = 0; i < entries_.size(); ++i) index_.emplace(entries_[i].first, i);
    }
    return before - entries_.size();
  }
  // `count` may come from a file: memory is only set aside up to a bound.
  void Reserve(size_t count) {
    count = std::min<size_t>(count, size_t{1} << 20);
    entries_.reserve(count);
    index_.reserve(count);
  }

 private:
  std::vector<Entry> entries_;
  std::unordered_map<Id, size_t> index_;
};

}  // namespace holba
