// SPDX-License-Identifier: BSD-3-Clause
// Pointers by id. Ids that count up, as those of models do, stand in a table with a cell for each:
// to find one is to read one cell, and the next ids are beside it. Ids that are far greater than
// their number are in a hash table.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace holba {

template <typename Id, typename T>
class IdTable {
  static_assert(std::is_unsigned_v<Id>);

 public:
  // Null: no such id.
  T* Find(Id id) const {
    if (id < dense_.size()) return dense_[id];
    return sparse_.empty() ? nullptr : sparse_[CellOf(id)].value;
  }

  // The id is not there yet; the value is not null.
  void Add(Id id, T* value) {
    ++size_;
    if (id >= dense_.size() && id < kCellsPerId * size_ + kMinCells)
      GrowDense(static_cast<size_t>(id) + 1);
    if (id < dense_.size()) {
      dense_[id] = value;
    } else {
      AddSparse(id, value);
    }
  }

  // The id must be there.
  void Remove(Id id) {
    --size_;
    if (id < dense_.size()) {
      dense_[id] = nullptr;
    } else {
      RemoveSparse(id);
    }
  }

  // Memory for ids up to `count`.
  void Reserve(size_t count) {
    if (count >= dense_.size()) GrowDense(count + 1);
  }

 private:
  // The table has fewer than twice as many cells.
  static constexpr size_t kCellsPerId = 4, kMinCells = 16;

  // Open addressing with linear probing; as many cells as a power of two, half of them empty at
  // least.
  struct Cell {
    Id id = 0;
    T* value = nullptr;  // null: the cell is empty
  };

  // Each time twice as large at least: the cost of all times together is that of the last.
  void GrowDense(size_t size) {
    dense_.resize(std::max(size, 2 * dense_.size()));
    if (num_sparse_ == 0) return;
    const std::vector<Cell> before = std::move(sparse_);
    sparse_.clear();
    num_sparse_ = 0;
    for (const Cell& cell : before) {
      if (cell.value == nullptr) continue;
      if (cell.id < dense_.size()) {
        dense_[cell.id] = cell.value;
      } else {
        AddSparse(cell.id, cell.value);
      }
    }
  }

  size_t Home(Id id) const {
    return static_cast<size_t>((static_cast<uint64_t>(id) * 0x9e3779b97f4a7c15ULL) >> shift_);
  }
  // The cell of an id, or the empty one where it would be.
  size_t CellOf(Id id) const {
    const size_t mask = sparse_.size() - 1;
    size_t i = Home(id);
    while (sparse_[i].value != nullptr && sparse_[i].id != id) i = (i + 1) & mask;
    return i;
  }
  void AddSparse(Id id, T* value) {
    if (2 * (num_sparse_ + 1) > sparse_.size()) {
      std::vector<Cell> before(sparse_.empty() ? 16 : 2 * sparse_.size());
      before.swap(sparse_);
      shift_ = before.empty() ? 60 : shift_ - 1;
      for (const Cell& cell : before) {
        if (cell.value != nullptr) sparse_[CellOf(cell.id)] = cell;
      }
    }
    sparse_[CellOf(id)] = {id, value};
    ++num_sparse_;
  }
  // Cells behind the removed one move up, so that every probe still meets its cell before an empty
  // one.
  void RemoveSparse(Id id) {
    const size_t mask = sparse_.size() - 1;
    size_t hole = CellOf(id);
    for (size_t i = (hole + 1) & mask; sparse_[i].value != nullptr; i = (i + 1) & mask) {
      if (((i - Home(sparse_[i].id)) & mask) < ((i - hole) & mask)) continue;
      sparse_[hole] = sparse_[i];
      hole = i;
    }
    sparse_[hole] = {};
    --num_sparse_;
  }

  size_t size_ = 0;
  std::vector<T*> dense_;
  std::vector<Cell> sparse_;
  size_t num_sparse_ = 0;
  int shift_ = 0;
};

}  // namespace holba
