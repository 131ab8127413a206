// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_store.h"

#include <algorithm>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/frontend/importers/hdf5_file.h"
#include "holba/frontend/importers/import_names.h"
#include "holba/frontend/importers/npz.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

std::string LowerExtension(const fs::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return extension;
}

void AddNpz(const fs::path& path, const std::string& prefix,
            const std::function<bool(std::string_view)>& wanted, StoredArrays* arrays) {
  const NpzArchive archive(ReadFileBytes(path), path);
  for (const std::string& name : archive.Names()) {
    const std::string key = prefix + name;
    if (!wanted(key)) continue;
    (*arrays)[key] = {archive.Read(name), path.string() + ": '" + name + "'"};
  }
}

}  // namespace

bool HasHdf5Extension(const fs::path& path) {
  const std::string extension = LowerExtension(path);
  return extension == ".h5" || extension == ".hdf5" || extension == ".hdf";
}

bool HoldsArrays(const fs::path& path) {
  const std::string extension = LowerExtension(path);
  return fs::is_directory(path) || extension == ".npy" || extension == ".npz" ||
         HasHdf5Extension(path);
}

std::pair<std::string_view, std::string_view> SplitLast(std::string_view path) {
  const size_t slash = path.rfind('/');
  if (slash == std::string_view::npos) return {"", path};
  return {path.substr(0, slash), path.substr(slash + 1)};
}

std::map<std::string, fs::path> FilesBelow(const fs::path& folder) {
  std::map<std::string, fs::path> files;
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    if (!it->is_regular_file()) continue;
    files.emplace(it->path().lexically_relative(folder).generic_string(), it->path());
  }
  if (error) throw CannotBeRead(folder, error.message());
  return files;
}

StoredArrays ReadStoredArrays(const fs::path& path,
                              const std::function<bool(std::string_view path)>& wanted) {
  StoredArrays arrays;
  if (!fs::exists(path)) throw NoSuchFileOrFolder(path);
  if (fs::is_directory(path)) {
    for (const auto& [name, file] : FilesBelow(path)) {
      const std::string stem(WithoutExtension(name));
      const std::string extension = LowerExtension(file);
      if (extension == ".npz") {
        AddNpz(file, stem + "/", wanted, &arrays);
      } else if (extension == ".npy" && wanted(stem)) {
        arrays[stem] = {ParseNpy(ReadFileBytes(file), file.string()), file.string()};
      }
    }
  } else if (HasHdf5Extension(path)) {
    for (auto& [name, array] : ReadHdf5(path, wanted)) {
      arrays[name] = {std::move(array), path.string() + ": '" + name + "'"};
    }
  } else if (LowerExtension(path) == ".npz") {
    AddNpz(path, "", wanted, &arrays);
  } else if (LowerExtension(path) == ".npy") {
    const std::string stem = path.stem().string();
    if (wanted(stem)) arrays[stem] = {ParseNpy(ReadFileBytes(path), path.string()), path.string()};
  } else {
    throw InputError(path, "expected a folder, or a file that ends in .npy, .npz or .h5");
  }
  return arrays;
}

}  // namespace holba
