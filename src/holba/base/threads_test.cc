// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/threads.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#if defined(__unix__)
#include <sys/wait.h>
#include <unistd.h>
#endif

namespace holba {
namespace {

TEST(ParallelTasks, EveryTaskRunsOnce) {
  for (const int num_threads : {1, 2, 3, 8, -1}) {
    for (const size_t num_tasks : {0, 1, 2, 7, 1000}) {
      std::vector<std::atomic<int>> count(num_tasks);
      ParallelTasks(num_threads, num_tasks, [&](size_t task) { count[task].fetch_add(1); });
      for (const auto& c : count) EXPECT_EQ(c.load(), 1) << num_threads << " " << num_tasks;
    }
  }
}

TEST(ParallelTasks, ManyRegionsInARowLoseNoTask) {
  std::atomic<size_t> total = 0;
  for (int region = 0; region < 20000; ++region) {
    ParallelTasks(2 + region % 3, 4, [&](size_t task) { total += task; });
  }
  EXPECT_EQ(total.load(), 20000u * 6u);
}

TEST(ParallelTasks, OneThreadRunsInOrderOnTheCaller) {
  std::vector<size_t> order;
  const auto caller = std::this_thread::get_id();
  ParallelTasks(1, 5, [&](size_t task) {
    EXPECT_EQ(std::this_thread::get_id(), caller);
    order.push_back(task);
  });
  EXPECT_EQ(order, (std::vector<size_t>{0, 1, 2, 3, 4}));
}

TEST(ParallelTasks, ATaskMayWaitForAnEarlierOne) {
  for (const int num_threads : {1, 2, 4}) {
    std::vector<std::atomic<bool>> done(200);
    ParallelTasks(num_threads, done.size(), [&](size_t task) {
      if (task > 0) {
        for (int step = 0; !done[task - 1].load(); ++step) SpinWait(step);
      }
      done[task] = true;
    });
    for (const auto& d : done) EXPECT_TRUE(d.load());
  }
}

TEST(ParallelTasks, ANestedRegionRunsOnItsCaller) {
  std::atomic<int> count = 0;
  ParallelTasks(2, 8, [&](size_t) {
    const auto outer = std::this_thread::get_id();
    ParallelTasks(2, 8, [&](size_t) {
      EXPECT_EQ(std::this_thread::get_id(), outer);
      ++count;
    });
  });
  EXPECT_EQ(count.load(), 64);
}

TEST(ParallelTasks, TwoThreadsOfTheProgramMayEachHaveARegion) {
  std::atomic<int> count = 0;
  const auto work = [&] {
    for (int i = 0; i < 500; ++i) ParallelTasks(2, 10, [&](size_t) { ++count; });
  };
  std::thread other(work);
  work();
  other.join();
  EXPECT_EQ(count.load(), 2 * 500 * 10);
}

TEST(ParallelTasks, TheFirstTaskThatThrowsIsReportedAndTheOthersStillRun) {
  for (const int num_threads : {1, 2, 4}) {
    std::atomic<int> count = 0;
    std::string message;
    try {
      ParallelTasks(num_threads, 100, [&](size_t task) {
        ++count;
        if (task == 13 || task == 77) throw std::runtime_error(std::to_string(task));
      });
    } catch (const std::runtime_error& error) {
      message = error.what();
    }
    EXPECT_EQ(message, "13");
    EXPECT_EQ(count.load(), 100);
    ParallelTasks(num_threads, 3, [&](size_t) { ++count; });
    EXPECT_EQ(count.load(), 103);
  }
}

TEST(ParallelFor, RangesCoverTheWholeInOrder) {
  for (const int num_threads : {1, 2, 5}) {
    for (const size_t size : {0, 1, 3, 5, 1001}) {
      std::vector<std::atomic<int>> count(size);
      ParallelFor(num_threads, size, [&](size_t begin, size_t end) {
        EXPECT_LT(begin, end);
        for (size_t i = begin; i < end; ++i) ++count[i];
      });
      for (const auto& c : count) EXPECT_EQ(c.load(), 1);
    }
  }
}

#if defined(__unix__)
TEST(ParallelTasks, AForkedChildHasThreadsOfItsOwn) {
  const auto sum = [] {
    std::atomic<size_t> total = 0;
    for (int region = 0; region < 100; ++region) {
      ParallelTasks(2, 50, [&](size_t task) { total += task; });
    }
    return total.load();
  };
  const size_t expected = 100 * 49 * 50 / 2;
  ASSERT_EQ(sum(), expected);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    // Both threads must meet, which fails (by the alarm) if the child has no second one.
    alarm(60);
    std::atomic<int> met = 0;
    ParallelTasks(2, 2, [&](size_t) {
      ++met;
      for (int step = 0; met.load() < 2; ++step) SpinWait(step);
    });
    _exit(sum() == expected ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  EXPECT_EQ(sum(), expected);
}
#endif

}  // namespace
}  // namespace holba
