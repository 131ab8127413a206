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

// One region at a time. Its word `state_` holds the number of the region, whether threads may still
// join it, and how many have joined and not left; the other members of the region change only while
// it is closed and empty, so a thread that wakes late finds it closed and touches nothing.
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

  // False: the pool is taken by another thread of the program.
  bool Run(int num_threads, size_t num_tasks, FunctionRef<void(size_t)> body) {
    std::unique_lock taken(region_mutex_, std::try_to_lock);
    if (!taken.owns_lock()) return false;
    Grow(num_threads - 1);
    body_ = &body;
    num_tasks_ = num_tasks;
    next_task_.store(0, std::memory_order_relaxed);
    max_helpers_ = num_threads - 1;
    first_error_task_ = std::numeric_limits<size_t>::max();
    error_ = nullptr;
    const uint64_t region = (state_.load(std::memory_order_relaxed) >> kRegionShift) + 1;
    state_.store((region << kRegionShift) | kOpen, std::memory_order_seq_cst);
    if (num_sleeping_.load(std::memory_order_seq_cst) > 0) {
      std::lock_guard lock(mutex_);
      wake_.notify_all();
    }
    in_region = true;
    RunTasks();
    in_region = false;
    state_.fetch_and(~kOpen, std::memory_order_acq_rel);
    const auto left = [this] {
      return (state_.load(std::memory_order_seq_cst) & kHelpersMask) == 0;
    };
    if (!SpinUntil(left)) {
      std::unique_lock lock(mutex_);
      caller_sleeps_.store(true, std::memory_order_seq_cst);
      all_left_.wait(lock, left);
      caller_sleeps_.store(false, std::memory_order_relaxed);
    }
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
    return true;
  }

 private:
  static constexpr int kRegionShift = 16;
  static constexpr uint64_t kOpen = 1 << 15;
  static constexpr uint64_t kHelpersMask = kOpen - 1;

  void Grow(int num_helpers) {
    while (static_cast<int>(threads_.size()) < std::min(num_helpers, kMaxThreads)) {
      try {
        threads_.emplace_back([this] { Work(); });
      } catch (const std::system_error&) {
        return;  // the system has no more threads to give: the ones there are do the work
      }
    }
  }

  void RunTasks() {
    for (;;) {
      const size_t task = next_task_.fetch_add(1, std::memory_order_relaxed);
      if (task >= num_tasks_) return;
      try {
        (*body_)(task);
      } catch (...) {
        std::lock_guard lock(error_mutex_);
        if (task < first_error_task_) {
          first_error_task_ = task;
          error_ = std::current_exception();
        }
      }
    }
  }

  void Work() {
    in_region = true;
    uint64_t last_region = 0;
    const auto open = [&] {
      const uint64_t state = state_.load(std::memory_order_seq_cst);
      return (state & kOpen) != 0 && (state >> kRegionShift) != last_region;
    };
    for (;;) {
      if (!SpinUntil([&] { return open() || stop_; })) {
        std::unique_lock lock(mutex_);
        num_sleeping_.fetch_add(1, std::memory_order_seq_cst);
        wake_.wait(lock, [&] { return open() || stop_; });
        num_sleeping_.fetch_sub(1, std::memory_order_seq_cst);
      }
      if (stop_) return;
      uint64_t state = state_.load(std::memory_order_acquire);
      bool joined = false;
      while ((state & kOpen) != 0 && !joined) {
        last_region = state >> kRegionShift;
        // max_helpers_ may be the next region's by now; then the exchange fails.
        if ((state & kHelpersMask) >= static_cast<uint64_t>(max_helpers_)) break;
        joined = state_.compare_exchange_weak(state, state + 1, std::memory_order_acq_rel);
      }
      if (!joined) continue;
      RunTasks();
      const uint64_t before = state_.fetch_sub(1, std::memory_order_seq_cst);
      if ((before & kHelpersMask) == 1 && caller_sleeps_.load(std::memory_order_seq_cst)) {
        std::lock_guard lock(mutex_);
        all_left_.notify_one();
      }
    }
  }

  std::mutex region_mutex_;  // held by the thread whose region it is
  std::vector<std::thread> threads_;

  alignas(64) std::atomic<uint64_t> state_{0};
  alignas(64) std::atomic<size_t> next_task_{0};
  alignas(64) const FunctionRef<void(size_t)>* body_ = nullptr;
  size_t num_tasks_ = 0;
  std::atomic<int> max_helpers_{0};

  std::mutex error_mutex_;
  size_t first_error_task_ = 0;
  std::exception_ptr error_;

  std::mutex mutex_;  // of sleep
  std::condition_variable wake_;
  std::condition_variable all_left_;
  std::atomic<int> num_sleeping_{0};
  std::atomic<bool> caller_sleeps_{false};
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
