// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/threads.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <limits>
#include <mutex>
#include <new>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#if defined(__unix__) || defined(__APPLE__)
#include <pthread.h>
#endif

#include "holba/base/interruption.h"

namespace holba {
namespace {

// Past the time that a region closely followed by another one leaves idle, short of what would
// starve other programs.
constexpr std::chrono::microseconds kSpinTime{50};
constexpr int kMaxThreads = 512;

thread_local bool in_region = false;

void Pause() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

// Spins until done() or the spin time is over; true: done.
template <typename Done>
bool SpinUntil(const Done& done) {
  const auto start = std::chrono::steady_clock::now();
  do {
    for (int i = 0; i < 64; ++i) {
      if (done()) return true;
      Pause();
    }
  } while (std::chrono::steady_clock::now() - start < kSpinTime);
  return done();
}

// The regions that are open at a time share the workers. A region is a slot: the word `state` holds
// whether workers may still join it, how many may, and how many have joined and not left. A worker
// joins by changing that word alone, whichever region it belongs to by then; the other members of a
// slot change only while it is closed and empty. The pool has as many workers as all regions ask
// for together, so each of them gets what it asks for.
class Pool {
 public:
  ~Pool() {
    {
      std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    for (std::thread& thread : threads_) {
      // exit() called from inside a task: that thread cannot wait for itself.
      if (thread.get_id() == std::this_thread::get_id()) {
        thread.detach();
      } else {
        thread.join();
      }
    }
  }

  // False: all slots are taken.
  bool Run(int num_threads, size_t num_tasks, FunctionRef<void(size_t)> body) {
    Region* const region = TakeRegion();
    if (region == nullptr) return false;
    const int num_helpers = std::min(num_threads - 1, kMaxThreads);
    Grow(num_helpers_wanted_.fetch_add(num_helpers) + num_helpers);
    region->body = &body;
    region->num_tasks = num_tasks;
    region->next_task.store(0, std::memory_order_relaxed);
    region->first_error_task = std::numeric_limits<size_t>::max();
    region->state.store(kOpen | static_cast<uint32_t>(num_helpers) << kMaxHelpersShift,
                        std::memory_order_seq_cst);
    if (num_sleeping_.load(std::memory_order_seq_cst) > 0) {
      std::lock_guard lock(mutex_);
      wake_.notify_all();
    }
    in_region = true;
    RunTasks(region);
    in_region = false;
    if ((region->state.load(std::memory_order_relaxed) & kOpen) != 0)
      region->state.fetch_and(~kOpen, std::memory_order_acq_rel);
    WaitForHelpers(region);
    num_helpers_wanted_.fetch_sub(num_helpers, std::memory_order_relaxed);
    const std::exception_ptr error = std::exchange(region->error, nullptr);
    region->taken.store(false, std::memory_order_release);
    if (error) std::rethrow_exception(error);
    return true;
  }

 private:
  static constexpr uint32_t kOpen = uint32_t{1} << 31;
  static constexpr int kMaxHelpersShift = 16;
  static constexpr uint32_t kCountMask = 0x7fff;
  static_assert(kMaxThreads <= static_cast<int>(kCountMask));
  // Callers at a time; one more works alone.
  static constexpr size_t kNumRegions = 32;

  struct Region {
    // On a line of its own: helpers read the others while the caller may write it.
    alignas(64) std::atomic<bool> taken{false};
    alignas(64) std::atomic<uint32_t> state{0};
    alignas(64) std::atomic<size_t> next_task{0};
    alignas(64) const FunctionRef<void(size_t)>* body = nullptr;
    size_t num_tasks = 0;
    std::atomic<bool> caller_sleeps{false};
    std::condition_variable all_left;

    std::mutex error_mutex;
    size_t first_error_task = 0;
    std::exception_ptr error;
  };

  static bool IsJoinable(uint32_t state) {
    return (state & kOpen) != 0 && (state & kCountMask) < (state >> kMaxHelpersShift & kCountMask);
  }

  Region* TakeRegion() {
    for (size_t i = 0; i < kNumRegions; ++i) {
      Region& region = regions_[i];
      if (region.taken.load(std::memory_order_relaxed)) continue;
      if (region.taken.exchange(true, std::memory_order_acquire)) continue;
      // Workers look at the regions that were ever used.
      size_t used = num_regions_used_.load(std::memory_order_relaxed);
      while (used < i + 1 && !num_regions_used_.compare_exchange_weak(used, i + 1)) {
      }
      return &region;
    }
    return nullptr;
  }

  void Grow(int num_helpers) {
    if (num_workers_.load(std::memory_order_relaxed) >= std::min(num_helpers, kMaxThreads)) return;
    std::lock_guard lock(grow_mutex_);
    while (static_cast<int>(threads_.size()) < std::min(num_helpers, kMaxThreads)) {
      try {
        threads_.emplace_back([this] { Work(); });
      } catch (const std::system_error&) {
        return;  // the system has no more threads to give: the ones there are do the work
      }
      num_workers_.store(static_cast<int>(threads_.size()), std::memory_order_relaxed);
    }
  }

  // Until no task is left to begin.
  static void RunTasks(Region* region) {
    for (;;) {
      const size_t task = region->next_task.fetch_add(1, std::memory_order_relaxed);
      if (task >= region->num_tasks) return;
      try {
        (*region->body)(task);
      } catch (...) {
        std::lock_guard lock(region->error_mutex);
        if (task < region->first_error_task) {
          region->first_error_task = task;
          region->error = std::current_exception();
        }
      }
    }
  }

  void WaitForHelpers(Region* region) {
    const auto left = [region] {
      return (region->state.load(std::memory_order_seq_cst) & kCountMask) == 0;
    };
    if (SpinUntil(left)) return;
    std::unique_lock lock(mutex_);
    region->caller_sleeps.store(true, std::memory_order_seq_cst);
    region->all_left.wait(lock, left);
    region->caller_sleeps.store(false, std::memory_order_relaxed);
  }

  // The next one from `*last` on that a worker can join, which is then `*last`.
  bool FindJoinable(size_t* last) const {
    const size_t used = num_regions_used_.load(std::memory_order_seq_cst);
    for (size_t i = 0; i < used; ++i) {
      const size_t candidate = *last + i < used ? *last + i : *last + i - used;
      if (IsJoinable(regions_[candidate].state.load(std::memory_order_seq_cst))) {
        *last = candidate;
        return true;
      }
    }
    return false;
  }

  void Work() {
    in_region = true;
    size_t last = 0;  // the region joined last: its caller is likely to have another one
    const auto has_work = [&] { return FindJoinable(&last) || stop_; };
    for (;;) {
      if (!SpinUntil(has_work)) {
        std::unique_lock lock(mutex_);
        num_sleeping_.fetch_add(1, std::memory_order_seq_cst);
        wake_.wait(lock, has_work);
        num_sleeping_.fetch_sub(1, std::memory_order_seq_cst);
      }
      if (stop_) return;
      Region* const region = &regions_[last];
      uint32_t state = region->state.load(std::memory_order_acquire);
      bool joined = false;
      while (IsJoinable(state) && !joined)
        joined = region->state.compare_exchange_weak(state, state + 1, std::memory_order_acq_rel);
      if (!joined) continue;
      RunTasks(region);
      // The first one who finds no task left closes the region: nobody needs to join it any more.
      uint32_t before = region->state.load(std::memory_order_relaxed);
      while (!region->state.compare_exchange_weak(before, (before & ~kOpen) - 1)) {
      }
      if ((before & kCountMask) == 1 && region->caller_sleeps.load(std::memory_order_seq_cst)) {
        std::lock_guard lock(mutex_);
        region->all_left.notify_one();
      }
    }
  }

  Region regions_[kNumRegions];
  std::atomic<size_t> num_regions_used_{0};
  alignas(64) std::atomic<int> num_helpers_wanted_{0};  // by all regions that are taken

  std::mutex grow_mutex_;
  std::vector<std::thread> threads_;
  std::atomic<int> num_workers_{0};

  std::mutex mutex_;  // of sleep
  std::condition_variable wake_;
  std::atomic<int> num_sleeping_{0};
  std::atomic<bool> stop_{false};
};

// The pool of this process: made on first use, joined at exit. In the child of a fork it is
// forgotten (its threads do not exist there), reachable from `forgotten` for leak checkers.
class PoolOfProcess {
 public:
  PoolOfProcess() {
#if defined(__unix__) || defined(__APPLE__)
    pthread_atfork(nullptr, nullptr, [] {
      Get().forgotten_ = Get().pool_.exchange(nullptr);
      new (&Get().mutex_) std::mutex;  // another thread of the parent may have held it
    });
#endif
  }
  ~PoolOfProcess() { delete pool_.exchange(nullptr); }

  static PoolOfProcess& Get() {
    static PoolOfProcess instance;
    return instance;
  }

  Pool& pool() {
    Pool* pool = pool_.load(std::memory_order_acquire);
    if (pool != nullptr) return *pool;
    std::lock_guard lock(mutex_);
    if (pool_.load() == nullptr) pool_.store(new Pool);
    return *pool_.load();
  }

 private:
  std::mutex mutex_;
  std::atomic<Pool*> pool_{nullptr};
  Pool* forgotten_ = nullptr;
};

}  // namespace

int NumThreads(int requested) {
  if (requested > 0) return requested;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void ParallelTasks(int num_threads, size_t num_tasks, FunctionRef<void(size_t)> body) {
  if (!in_region) ThrowIfInterrupted();
  const int threads = static_cast<int>(std::min<size_t>(NumThreads(num_threads), num_tasks));
  if (threads > 1 && !in_region && PoolOfProcess::Get().pool().Run(threads, num_tasks, body)) {
    return;
  }
  std::exception_ptr error;
  for (size_t task = 0; task < num_tasks; ++task) {
    try {
      body(task);
    } catch (...) {
      if (!error) error = std::current_exception();
    }
  }
  if (error) std::rethrow_exception(error);
}

void ParallelFor(int num_threads, size_t size, FunctionRef<void(size_t, size_t)> body) {
  if (size == 0) return;
  const size_t num_ranges = std::min<size_t>(NumThreads(num_threads), size);
  ParallelTasks(num_threads, num_ranges, [&](size_t range) {
    body(size * range / num_ranges, size * (range + 1) / num_ranges);
  });
}

void SpinWait(int step) {
  if (step < 1000) {
    Pause();
  } else {
    std::this_thread::yield();
  }
}

}  // namespace holba
