// SPDX-License-Identifier: BSD-3-Clause
// A file or folder of arrays as one list of paths ("folder/image.jpg/lines"), whichever form it
// has: HDF5, an .npz archive, or a folder of .npz and .npy files (the file's path without its
// extension, then the name in the archive).
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "holba/frontend/importers/import_arrays.h"

namespace holba {

struct StoredArray {
  NumericArray array;
  std::string place;  // for messages: the file, and where in it
};
using StoredArrays = std::map<std::string, StoredArray>;

// Whether ReadStoredArrays takes it: a folder, or a file by its extension (npy, npz, h5, hdf5,
// hdf).
bool HoldsArrays(const std::filesystem::path& path);
// Whether the path is a file of HDF5, by its extension.
bool HasHdf5Extension(const std::filesystem::path& path);

// All arrays whose path is wanted. Throws InputError.
StoredArrays ReadStoredArrays(const std::filesystem::path& path,
                              const std::function<bool(std::string_view path)>& wanted);

// "a/b/c" -> {"a/b", "c"}; without '/': {"", "c"}.
std::pair<std::string_view, std::string_view> SplitLast(std::string_view path);

// Regular files below a folder, ascending: path relative to it with '/'.
std::map<std::string, std::filesystem::path> FilesBelow(const std::filesystem::path& folder);

}  // namespace holba
