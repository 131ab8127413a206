// SPDX-License-Identifier: BSD-3-Clause
// Numbers the different keys that it is given 0, 1, 2, ... in the order in which they come. Open
// addressing in one array: a look-up costs a few nanoseconds where the keys are those of a part of
// a model.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace holba {

class FlatIndex {
 public:
  static constexpr uint32_t kNone = ~uint32_t{0};

  explicit FlatIndex(size_t expected = 0) { Resize(expected); }

  size_t size() const { return size_; }
  // Number of a key; kNone: it is not there. No key is 2^64 - 1 (kNoId).
  uint32_t Find(uint64_t key) const {
    for (size_t slot = Start(key);; slot = (slot + 1) & mask_) {
      if (slots_[slot].key == key) return slots_[slot].idx;
      if (slots_[slot].key == kEmpty) return kNone;
    }
  }
  bool contains(uint64_t key) const { return Find(key) != kNone; }
  // Number of a key, and whether it is new.
  std::pair<uint32_t, bool> Add(uint64_t key) {
    if (2 * (size_ + 1) > slots_.size()) Resize(2 * size_ + 8);
    size_t slot = Start(key);
    while (slots_[slot].key != key) {
      if (slots_[slot].key == kEmpty) {
        slots_[slot] = {key, static_cast<uint32_t>(size_)};
        return {static_cast<uint32_t>(size_++), true};
      }
      slot = (slot + 1) & mask_;
    }
    return {slots_[slot].idx, false};
  }

 private:
  static constexpr uint64_t kEmpty = ~uint64_t{0};
  struct Slot {
    uint64_t key = kEmpty;
    uint32_t idx = kNone;
  };

  size_t Start(uint64_t key) const { return (key * 0x9e3779b97f4a7c15ULL) >> shift_; }

  void Resize(size_t expected) {
    const size_t count = std::bit_ceil(2 * std::max<size_t>(expected, 8));
    std::vector<Slot> old(count);
    old.swap(slots_);
    mask_ = count - 1;
    shift_ = 64 - std::countr_zero(count);
    for (const Slot& entry : old) {
      if (entry.key == kEmpty) continue;
      size_t slot = Start(entry.key);
      while (slots_[slot].key != kEmpty) slot = (slot + 1) & mask_;
      slots_[slot] = entry;
    }
  }

  std::vector<Slot> slots_;
  size_t mask_ = 0;
  int shift_ = 64;
  size_t size_ = 0;
};

}  // namespace holba
