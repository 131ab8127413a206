// SPDX-License-Identifier: BSD-3-Clause
// Work shared among threads. The threads are started on first use, kept until the process ends, and
// wait by spinning for some microseconds before they sleep, so that a region of work costs about a
// microsecond while others follow it closely. A region begun inside another runs on its caller
// alone. Regions of several callers at a time (up to 32) each get the threads that they ask for.
// After a fork the child starts threads of its own.
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>

namespace holba {

// A callable that outlives the call it is passed to: a reference, never a copy.
template <typename Signature>
class FunctionRef;

template <typename Result, typename... Args>
class FunctionRef<Result(Args...)> {
 public:
  template <typename F>
  requires(!std::is_same_v<std::remove_cvref_t<F>, FunctionRef> &&
           std::is_invocable_r_v<Result, F&, Args...>)
      FunctionRef(F&& f)  // NOLINT: implicit, as for std::function
      : object_(const_cast<void*>(static_cast<const void*>(std::addressof(f)))),
        call_([](void* object, Args... args) -> Result {
          return (*static_cast<std::remove_reference_t<F>*>(object))(std::forward<Args>(args)...);
        }) {}

  Result operator()(Args... args) const { return call_(object_, std::forward<Args>(args)...); }

 private:
  void* object_;
  Result (*call_)(void*, Args...);
};

// What a num_threads means, everywhere: so many threads, or one per hardware thread if it is -1 (or
// 0); at least 1.
int NumThreads(int requested);

// Calls body(task) once for every task in [0, num_tasks) on up to num_threads threads (-1: one per
// hardware thread); which thread runs which task is unspecified, so results must not depend on it.
// Tasks are begun in ascending order, each by a running thread: a task may wait for an earlier one.
// num_threads 1: in order, on the caller. All tasks are run; then the exception of the first task
// that threw is rethrown.
void ParallelTasks(int num_threads, size_t num_tasks, FunctionRef<void(size_t task)> body);

// Calls body(begin, end) on consecutive ranges that cover [0, size). The ranges depend on size and
// num_threads only, so that sums kept per range repeat from run to run. Exceptions are rethrown
// here.
void ParallelFor(int num_threads, size_t size, FunctionRef<void(size_t begin, size_t end)> body);

// One step of waiting for another thread's memory: tells the processor at first, then yields to
// other threads. `step` counts from 0 while the wait lasts.
void SpinWait(int step);

}  // namespace holba
