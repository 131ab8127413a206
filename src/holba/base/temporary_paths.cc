// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/temporary_paths.h"

#include <fcntl.h>
#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "holba/base/check.h"

namespace holba {
namespace {

// Never destroyed: the watcher may still look at it while the process ends.
struct Registry {
  // Locked in this order.
  std::recursive_mutex hold;
  std::mutex mutex;
  std::multiset<std::filesystem::path> paths;
};
Registry& GetRegistry() {
  static Registry* const registry = new Registry;
  return *registry;
}

std::atomic<bool> interrupted = false;
int signal_pipe[2] = {-1, -1};

// All that a signal handler may safely do: pass the number on. A second signal ends at once.
void PassOn(int signal) {
  const int saved_errno = errno;
  if (interrupted.exchange(true)) {
    std::signal(signal, SIG_DFL);
    raise(signal);
  }
  const char number = static_cast<char>(signal);
  [[maybe_unused]] const ssize_t written = write(signal_pipe[1], &number, 1);
  errno = saved_errno;
}

void RemoveAll(Registry& registry) {
  const std::lock_guard lock(registry.mutex);
  for (const std::filesystem::path& path : registry.paths) {
    std::error_code ignored;
    // Moved aside first, so that a writer at work can add no more files to it.
    std::filesystem::path aside = path;
    aside += kRemovedSuffix;
    std::filesystem::rename(path, aside, ignored);
    std::filesystem::remove_all(aside, ignored);
    std::filesystem::remove_all(path, ignored);
  }
}

void Watch() {
  char number = 0;
  ssize_t got = 0;
  do {
    got = read(signal_pipe[0], &number, 1);
  } while (got < 0 && errno == EINTR);
  if (got != 1) return;
  Registry& registry = GetRegistry();
  // Kept to the end: no output is begun to be put in place any more.
  registry.hold.lock();
  RemoveAll(registry);
  std::signal(number, SIG_DFL);
  kill(getpid(), number);
  pause();
}

}  // namespace

TemporaryPath::TemporaryPath(std::filesystem::path path) : path_(std::filesystem::absolute(path)) {
  Registry& registry = GetRegistry();
  const std::lock_guard lock(registry.mutex);
  registry.paths.insert(path_);
}

TemporaryPath::~TemporaryPath() {
  if (keep_) return;
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
  Keep();
}

void TemporaryPath::Keep() {
  if (keep_) return;
  keep_ = true;
  Registry& registry = GetRegistry();
  const std::lock_guard lock(registry.mutex);
  registry.paths.erase(registry.paths.find(path_));
}

HoldSignals::HoldSignals() { GetRegistry().hold.lock(); }
HoldSignals::~HoldSignals() { GetRegistry().hold.unlock(); }

void RemoveTemporaryPathsOnSignal() {
  HOLBA_CHECK(signal_pipe[0] < 0);
  HOLBA_CHECK(pipe2(signal_pipe, O_CLOEXEC) == 0);
  GetRegistry();
  std::thread(Watch).detach();
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction action {};
    // A signal that the caller ignores (nohup) stays ignored.
    if (sigaction(signal, nullptr, &action) != 0 || action.sa_handler == SIG_IGN) continue;
    action = {};
    action.sa_handler = PassOn;
    action.sa_flags = SA_RESTART;
    sigemptyset(&action.sa_mask);
    sigaction(signal, &action, nullptr);
  }
}

bool Interrupted() { return interrupted; }

}  // namespace holba
