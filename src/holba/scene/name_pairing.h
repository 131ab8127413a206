// SPDX-License-Identifier: BSD-3-Clause
// Which names of two lists mean the same image, where programs write them differently: with another
// extension, upper or lower case, '\' for '/', from a deeper or a higher folder.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace holba {

struct NamePairing {
  // For each name of `a` the index in `b`; empty: none, or not decided. No index is there twice.
  std::vector<std::optional<size_t>> b_of_a;
  size_t num_whole = 0;      // pairs of equal names
  size_t num_by_ending = 0;  // pairs by the end of their paths
  size_t num_ambiguous = 0;  // names of `a` that several of `b` fit equally well
  // Of pairs by the end of their paths, one for each way in which names differ, and of names
  // without a pair.
  std::string examples;
  std::optional<size_t> unpaired_a, unpaired_b;

  size_t NumPairs() const { return num_whole + num_by_ending; }
};

// Equal names are pairs. Of the others those are that share the last component of their paths
// without extension, whatever its case, and most components before it; if several do, those whose
// case and then whose extension agree; if this is still so, none. A folder that both lists have is
// not taken for another one.
NamePairing PairNames(std::span<const std::string_view> a, std::span<const std::string_view> b);

// Names of `thing` ("image") that were paired otherwise than by being equal, for the log: "Paired 3
// images by their whole names and 7 by the ends of their paths: 'b/1.png' is '1.jpg'".
std::string HowPaired(std::string_view thing, size_t num_whole, size_t num_by_ending,
                      std::string_view examples);

// "folder/image.jpg" -> "folder/image"; what has no extension is returned as it is.
std::string_view WithoutExtension(std::string_view name);

}  // namespace holba
