// SPDX-License-Identifier: BSD-3-Clause
// Temporary files and folders that must not outlive the process: a writer fills one and renames it
// into place, so that the output is either the old one or a whole new one.
#pragma once

#include <filesystem>
#include <string_view>

namespace holba {

// What an interrupt renames is removed at once, or, if the program is killed while it does so, has
// this at the end of its name.
inline constexpr std::string_view kRemovedSuffix = ".removed";

// Registers `path` (which need not exist yet); its end removes what is there by then. After a
// rename into place nothing is, so a writer needs no other clean-up.
class TemporaryPath {
 public:
  explicit TemporaryPath(std::filesystem::path path);
  ~TemporaryPath();
  TemporaryPath(const TemporaryPath&) = delete;
  TemporaryPath& operator=(const TemporaryPath&) = delete;

  const std::filesystem::path& path() const { return path_; }

  // From now on what is there stays.
  void Keep();

 private:
  std::filesystem::path path_;
  bool keep_ = false;
};

// While one exists a signal waits: for the few steps of putting an output in place that must not be
// torn apart.
class HoldSignals {
 public:
  HoldSignals();
  ~HoldSignals();
  HoldSignals(const HoldSignals&) = delete;
  HoldSignals& operator=(const HoldSignals&) = delete;
};

// Makes SIGINT, SIGTERM and SIGHUP remove all registered paths before they end the process as
// usual. For programs (once, at the start), never called by the library itself.
void RemoveTemporaryPathsOnSignal();

// True from the moment such a signal came; what fails afterwards fails because its files are gone.
bool Interrupted();

}  // namespace holba
