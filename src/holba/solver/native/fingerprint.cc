// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/fingerprint.h"

#include <span>

namespace holba::native {
namespace {

// Two running sums; a 64 x 64 -> 128 bit product mixes all bits of each word into both.
class Mixer {
 public:
  void Add(uint64_t word) {
    state_[0] = Fold(state_[0] ^ word, kOdd[0]);
    state_[1] = Fold(state_[1] + word, kOdd[1]);
  }
  void Add(std::span<const BlockId> ids) {
    Add(ids.size());
    size_t i = 0;
    for (; i + 2 <= ids.size(); i += 2) Add(uint64_t{ids[i]} << 32 | ids[i + 1]);
    if (i < ids.size()) Add(ids[i]);
  }
  Fingerprint Get() const { return {Fold(state_[0], kOdd[1]), Fold(state_[1], kOdd[0])}; }

 private:
  static constexpr uint64_t kOdd[2] = {0x9E3779B97F4A7C15, 0xD1B54A32D192ED03};
  static uint64_t Fold(uint64_t a, uint64_t b) {
    const unsigned __int128 product = static_cast<unsigned __int128>(a) * b;
    return static_cast<uint64_t>(product) + static_cast<uint64_t>(product >> 64);
  }
  uint64_t state_[2] = {0x243F6A8885A308D3, 0x13198A2E03707344};
};

}  // namespace

Fingerprint FingerprintOf(const Problem& problem) {
  Mixer mixer;
  mixer.Add(problem.num_blocks());
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    // Manifolds live as long as the program: their addresses identify them.
    mixer.Add(static_cast<uint64_t>(reinterpret_cast<uintptr_t>(block.manifold)));
    mixer.Add(uint64_t{block.held} << 16 | uint64_t{block.constant} << 8 |
              static_cast<uint64_t>(block.role));
  }
  mixer.Add(problem.batches().size());
  for (const auto& batch : problem.batches()) {
    mixer.Add(static_cast<uint64_t>(batch->dim()) << 8 | static_cast<uint64_t>(batch->num_slots()));
    for (int s = 0; s < batch->num_slots(); ++s)
      mixer.Add(static_cast<uint64_t>(batch->tangent(s)));
    mixer.Add(batch->blocks());
  }
  return mixer.Get();
}

}  // namespace holba::native
