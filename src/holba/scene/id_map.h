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

namespace holba {

template <typename Id, typename T>
class IdMap {
  static_assert(std::is_unsigned_v<Id>);

 public:
  using Entry = std::pair<Id, T>;

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
    explicit Iterator(Entry* const* at) : at_(at) {}
    operator Iterator<const E>() const { return Iterator<const E>(at_); }  // NOLINT: as for pointers

    E& operator*() const { return **at_; }
    E* operator->() const { return *at_; }
    E& operator[](difference_type n) const { return *at_[n]; }
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
    Entry* const* at_ = nullptr;
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
  bool contains(Id id) const { return Find(id) != nullptr; }
  iterator begin() { return iterator(order_.data()); }
  iterator end() { return iterator(order_.data() + order_.size()); }
  const_iterator begin() const { return const_iterator(order_.data()); }
  const_iterator end() const { return const_iterator(order_.data() + order_.size()); }

  // Null: no such id.
  T* Find(Id id) {
    const Cell* cell = FindCell(id);
    return cell != nullptr ? &cell->entry->second : nullptr;
  }
  const T* Find(Id id) const {
    const Cell* cell = FindCell(id);
    return cell != nullptr ? &cell->entry->second : nullptr;
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
    const Cell* cell = FindCell(id);
    HOLBA_CHECK_MSG(cell != nullptr, "no id " + std::to_string(id));
    return cell->position;
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
    HOLBA_CHECK(order_.size() < kNoPosition);
    if (2 * (order_.size() + 1) > cells_.size()) Rehash(std::max<size_t>(16, 2 * cells_.size()));
    Slot* slot = TakeSlot();
    Entry* entry = new (&slot->entry) Entry(id, std::move(value));
    order_.push_back(entry);
    Insert({id, static_cast<uint32_t>(order_.size() - 1), entry});
    if (id >= next_id_ && id < std::numeric_limits<Id>::max()) next_id_ = id + 1;
    return true;
  }
  // The last record of the order takes the place of the one removed. False: no such id.
  bool Remove(Id id) {
    Cell* cell = const_cast<Cell*>(FindCell(id));
    if (cell == nullptr) return false;
    const uint32_t position = cell->position;
    Entry* removed = cell->entry;
    Erase(cell);
    Entry* last = order_.back();
    order_.pop_back();
    if (last != removed) {
      order_[position] = last;
      const_cast<Cell*>(FindCell(last->first))->position = position;
    }
    Free(removed);
    return true;
  }
  // Removes all whose id satisfies `predicate(id, value)`; the order of the others stays.
  template <typename Predicate>
  size_t RemoveIf(Predicate predicate) {
    const size_t before = order_.size();
    std::erase_if(order_, [&](Entry* e) {
      if (!predicate(e->first, std::as_const(e->second))) return false;
      Free(e);
      return true;
    });
    if (order_.size() != before) Rehash(cells_.size());
    return before - order_.size();
  }
  // `count` may come from a file: memory is only set aside up to a bound.
  void Reserve(size_t count) {
    count = std::min<size_t>(count, size_t{1} << 20);
    order_.reserve(count);
    if (count > slots_in_chunks_) AddChunk(count - slots_in_chunks_);
    size_t cells = std::max<size_t>(16, cells_.size());
    while (cells < 2 * count) cells *= 2;
    if (cells > cells_.size()) Rehash(cells);
  }

 private:
  static constexpr uint32_t kNoPosition = std::numeric_limits<uint32_t>::max();
  static constexpr size_t kMaxChunk = 4096;

  // Memory of one record; records do not move.
  union Slot {
    Slot() {}
    ~Slot() {}
    Entry entry;
  };
  // Open addressing with linear probing; as many cells as a power of two, half of them empty at least.
  struct Cell {
    Id id = 0;
    uint32_t position = kNoPosition;  // kNoPosition: the cell is empty
    Entry* entry = nullptr;
  };

  size_t Home(Id id) const {
    return static_cast<size_t>((static_cast<uint64_t>(id) * 0x9e3779b97f4a7c15ULL) >> shift_);
  }
  const Cell* FindCell(Id id) const {
    if (cells_.empty()) return nullptr;
    const size_t mask = cells_.size() - 1;
    for (size_t i = Home(id);; i = (i + 1) & mask) {
      const Cell& cell = cells_[i];
      if (cell.position == kNoPosition) return nullptr;
      if (cell.id == id) return &cell;
    }
  }
  void Insert(const Cell& added) {
    const size_t mask = cells_.size() - 1;
    size_t i = Home(added.id);
    while (cells_[i].position != kNoPosition) i = (i + 1) & mask;
    cells_[i] = added;
  }
  // Cells behind the erased one move up, so that every probe still meets its cell before an empty one.
  void Erase(Cell* erased) {
    const size_t mask = cells_.size() - 1;
    size_t hole = static_cast<size_t>(erased - cells_.data());
    for (size_t i = (hole + 1) & mask; cells_[i].position != kNoPosition; i = (i + 1) & mask) {
      if (((i - Home(cells_[i].id)) & mask) < ((i - hole) & mask)) continue;
      cells_[hole] = cells_[i];
      hole = i;
    }
    cells_[hole] = Cell{};
  }
  void Rehash(size_t num_cells) {
    cells_.assign(num_cells, Cell{});
    shift_ = 64;
    while (num_cells > 1) {
      num_cells /= 2;
      --shift_;
    }
    for (size_t i = 0; i < order_.size(); ++i)
      Insert({order_[i]->first, static_cast<uint32_t>(i), order_[i]});
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
  void Free(Entry* entry) {
    entry->~Entry();
    free_.push_back(reinterpret_cast<Slot*>(entry));
  }
  void DestroyAll() {
    for (Entry* entry : order_) entry->~Entry();
  }
  void CopyFrom(const IdMap& other) {
    next_id_ = other.next_id_;
    if (other.empty()) return;
    order_.reserve(other.size());
    AddChunk(other.size());
    for (const Entry& entry : other) order_.push_back(new (&TakeSlot()->entry) Entry(entry));
    Rehash(other.cells_.size());
  }
  void Swap(IdMap* other) noexcept {
    std::swap(order_, other->order_);
    std::swap(cells_, other->cells_);
    std::swap(shift_, other->shift_);
    std::swap(chunks_, other->chunks_);
    std::swap(slots_in_chunks_, other->slots_in_chunks_);
    std::swap(free_, other->free_);
    std::swap(next_id_, other->next_id_);
  }

  std::vector<Entry*> order_;
  std::vector<Cell> cells_;
  int shift_ = 64;
  std::vector<std::unique_ptr<Slot[]>> chunks_;
  size_t slots_in_chunks_ = 0;
  std::vector<Slot*> free_;
  Id next_id_ = 1;
};

}  // namespace holba
