// SPDX-License-Identifier: BSD-3-Clause
#include "apps/view/open_in_browser.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "holba/base/file_faults.h"

extern char** environ;

namespace holba {

std::filesystem::path TemporaryPage() {
  std::string folder = (std::filesystem::temp_directory_path() / "holba-view-XXXXXX").string();
  if (!mkdtemp(folder.data())) throw FolderCannotBeMade(folder, SystemFault());
  return std::filesystem::path(folder) / "model.html";
}

bool OpenInBrowser(const std::filesystem::path& path) {
#if defined(__APPLE__)
  const char* program = "open";
#else
  // Without a screen some systems would start a browser for text in this terminal.
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY")) return false;
  const char* program = "xdg-open";
#endif
  std::string argument = path.string();
  char* arguments[] = {const_cast<char*>(program), argument.data(), nullptr};
  pid_t pid = 0;
  if (posix_spawnp(&pid, program, nullptr, nullptr, arguments, environ) != 0) return false;
  int status = 0;
  return waitpid(pid, &status, 0) == pid && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace holba
