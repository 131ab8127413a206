// SPDX-License-Identifier: BSD-3-Clause
// Records by id, kept in the order in which they came (files are written in the order they were read).
// A reference to a record stays valid until the record is removed or the map ends; an iterator ends
// with any addition or removal. Finding, adding and removing a record take constant time (amortised).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/scene/id_table.h"

namespace holba {

template <typename Id, typename T>
class IdMap {
 public:
  using Entry = std::pair<Id, T>;

 private:
  // A record with its position in the order; records do not move.
  struct Slot {
    Slot() {}
    ~Slot() {}
    union {
      Entry entry;
    };
    uint32_t position;
  };

 public:
  // Goes over the records in their order; random access.
  template <typename E>
  class Iterator {
   public:
    using iterator_category = std::random_access_iterator_tag;
    using value_type = std::remove_const_t<E>;
    using difference_type = std::ptrdiff_t;
    using pointer = E*;
    using reference = E&;

    Iterator() = default;
    explicit Iterator(Slot* const* at) : at_(at) {}
    operator Iterator<const E>() const { return Iterator<const E>(at_); }  // NOLINT: as for pointers

    E& operator*() const { return (*at_)->entry; }
    E* operator->() const { return &(*at_)->entry; }
    E& operator[](difference_type n) const { return at_[n]->entry; }
    Iterator& operator++() { return ++at_, *this; }
    Iterator operator++(int) { return Iterator(at_++); }
    Iterator& operator--() { return --at_, *this; }
    Iterator operator--(int) { return Iterator(at_--); }
    Iterator& operator+=(difference_type n) { return at_ += n, *this; }
    Iterator& operator-=(difference_type n) { return at_ -= n, *this; }
    friend Iterator operator+(Iterator it, difference_type n) { return Iterator(it.at_ + n); }
    friend Iterator operator+(difference_type n, Iterator it) { return Iterator(it.at_ + n); }
    friend Iterator operator-(Iterator it, difference_type n) { return Iterator(it.at_ - n); }
    friend difference_type operator-(Iterator a, Iterator b) { return a.at_ - b.at_; }
    friend auto operator<=>(const Iterator&, const Iterator&) = default;

   private:
    Slot* const* at_ = nullptr;
  };
  using iterator = Iterator<Entry>;
  using const_iterator = Iterator<const Entry>;

  IdMap() = default;
  ~IdMap() { DestroyAll(); }
  IdMap(const IdMap& other) { CopyFrom(other); }
  IdMap(IdMap&& other) noexcept { Swap(&other); }
  IdMap& operator=(const IdMap& other) {
    if (this == &other) return *this;
    IdMap copy(other);
    Swap(&copy);
    return *this;
  }
  IdMap& operator=(IdMap&& other) noexcept {
    IdMap emptied(std::move(other));
    Swap(&emptied);
    return *this;
  }

  size_t size() const { return order_.size(); }
  bool empty() const { return order_.empty(); }
  bool contains(Id id) const { return slots_.Find(id) != nullptr; }
  iterator begin() { return iterator(order_.data()); }
  iterator end() { return iterator(order_.data() + order_.size()); }
  const_iterator begin() const { return const_iterator(order_.data()); }
  const_iterator end() const { return const_iterator(order_.data() + order_.size()); }

  // Null: no such id.
  T* Find(Id id) {
    Slot* slot = slots_.Find(id);
    return slot != nullptr ? &slot->entry.second : nullptr;
  }
  const T* Find(Id id) const {
    Slot* slot = slots_.Find(id);
    return slot != nullptr ? &slot->entry.second : nullptr;
  }
  T& at(Id id) {
    T* value = Find(id);
    HOLBA_CHECK_MSG(value != nullptr, "no id " + std::to_string(id));
    return *value;
  }
  const T& at(Id id) const {
    const T* value = Find(id);
    HOLBA_CHECK_MSG(value != nullptr, "no id " + std::to_string(id));
    return *value;
  }
  // Position of an id in iteration order; the id must be there.
  size_t IndexOf(Id id) const {
    const Slot* slot = slots_.Find(id);
    HOLBA_CHECK_MSG(slot != nullptr, "no id " + std::to_string(id));
    return slot->position;
  }

  // One more than the greatest id that the map has ever held, 1 for the first: no id is given twice
  // in the life of a map, also after removals.
  Id NextId() const {
    HOLBA_CHECK_MSG(next_id_ < std::numeric_limits<Id>::max(), "there is no id left");
    return next_id_;
  }

  // Goes to the end of the order. False: the id is there already, nothing was added.
  bool Add(Id id, T value) {
    if (contains(id)) return false;
    HOLBA_CHECK(order_.size() < std::numeric_limits<uint32_t>::max());
    Slot* slot = TakeSlot();
    new (&slot->entry) Entry(id, std::move(value));
    Append(slot);
    if (id >= next_id_ && id < std::numeric_limits<Id>::max()) next_id_ = id + 1;
    return true;
  }
  // The last record of the order takes the place of the one removed. False: no such id.
  bool Remove(Id id) {
    Slot* removed = slots_.Find(id);
    if (removed == nullptr) return false;
    Slot* last = order_.back();
    order_[removed->position] = last;
    last->position = removed->position;
    order_.pop_back();
    slots_.Remove(id);
    Free(removed);
    return true;
  }
  // Removes all whose id satisfies `predicate(id, value)`; the order of the others stays.
  template <typename Predicate>
  size_t RemoveIf(Predicate predicate) {
    const size_t before = order_.size();
    std::erase_if(order_, [&](Slot* slot) {
      if (!predicate(slot->entry.first, std::as_const(slot->entry.second))) return false;
      slots_.Remove(slot->entry.first);
      Free(slot);
      return true;
    });
    if (order_.size() == before) return 0;
    for (size_t i = 0; i < order_.size(); ++i) order_[i]->position = static_cast<uint32_t>(i);
    return before - order_.size();
  }
  // `count` may come from a file: memory is only set aside up to a bound.
  void Reserve(size_t count) {
    count = std::min<size_t>(count, size_t{1} << 20);
    order_.reserve(count);
    slots_.Reserve(count);
    if (count > slots_in_chunks_) AddChunk(count - slots_in_chunks_);
  }

 private:
  static constexpr size_t kMaxChunk = 4096;

  void Append(Slot* slot) {
    slot->position = static_cast<uint32_t>(order_.size());
    order_.push_back(slot);
    slots_.Add(slot->entry.first, slot);
  }

  void AddChunk(size_t size) {
    chunks_.push_back(std::make_unique<Slot[]>(size));
    slots_in_chunks_ += size;
    // Taken from the back, so that records lie in memory in the order in which they come.
    free_.reserve(free_.size() + size);
    const std::vector<Slot*> before = std::move(free_);
    free_.clear();
    for (size_t i = size; i-- > 0;) free_.push_back(&chunks_.back()[i]);
    free_.insert(free_.end(), before.begin(), before.end());
  }
  Slot* TakeSlot() {
    if (free_.empty()) AddChunk(std::clamp<size_t>(slots_in_chunks_, 4, kMaxChunk));
    Slot* slot = free_.back();
    free_.pop_back();
    return slot;
  }
  void Free(Slot* slot) {
    slot->entry.~Entry();
    free_.push_back(slot);
  }
  void DestroyAll() {
    for (Slot* slot : order_) slot->entry.~Entry();
  }
  void CopyFrom(const IdMap& other) {
    next_id_ = other.next_id_;
    if (other.empty()) return;
    order_.reserve(other.size());
    slots_.Reserve(other.size());
    AddChunk(other.size());
    for (const Entry& entry : other) {
      Slot* slot = TakeSlot();
      new (&slot->entry) Entry(entry);
      Append(slot);
    }
  }
  void Swap(IdMap* other) noexcept {
    std::swap(order_, other->order_);
    std::swap(slots_, other->slots_);
    std::swap(chunks_, other->chunks_);
    std::swap(slots_in_chunks_, other->slots_in_chunks_);
    std::swap(free_, other->free_);
    std::swap(next_id_, other->next_id_);
  }

  std::vector<Slot*> order_;
  IdTable<Id, Slot> slots_;
  std::vector<std::unique_ptr<Slot[]>> chunks_;
  size_t slots_in_chunks_ = 0;
  std::vector<Slot*> free_;
  Id next_id_ = 1;
};

}  // namespace holba
