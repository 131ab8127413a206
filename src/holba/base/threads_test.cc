// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/threads.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
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

// Waits until `count` is reached; false: not within a minute, as where too few threads take part.
bool Reaches(const std::atomic<int>& reached, int count) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  for (int step = 0; reached.load() < count; ++step) {
    if (std::chrono::steady_clock::now() > end) return false;
    SpinWait(step);
  }
  return true;
}

TEST(ParallelTasks, EveryCallerGetsTheThreadsThatItAsksFor) {
  constexpr int kNumCallers = 3, kNumThreads = 2;
  for (int repetition = 0; repetition < 50; ++repetition) {
    // All tasks of all callers are there at a time, which takes a thread for each of them.
    std::atomic<int> met = 0;
    std::atomic<int> alone = 0;
    const auto work = [&] {
      std::vector<std::thread::id> of_task(kNumThreads);
      ParallelTasks(kNumThreads, kNumThreads, [&](size_t task) {
        of_task[task] = std::this_thread::get_id();
        ++met;
        if (!Reaches(met, kNumCallers * kNumThreads)) ++alone;
      });
      EXPECT_NE(of_task[0], of_task[1]);
    };
    std::vector<std::thread> callers;
    for (int i = 0; i < kNumCallers; ++i) callers.emplace_back(work);
    for (std::thread& caller : callers) caller.join();
    ASSERT_EQ(alone.load(), 0);
  }
}

TEST(ParallelTasks, MoreCallersThanThePoolHasRegionsLoseNoTask) {
  constexpr int kNumCallers = 40;
  std::atomic<int> count = 0, inside = 0, alone = 0;
  std::vector<std::thread> callers;
  for (int i = 0; i < kNumCallers; ++i) {
    callers.emplace_back([&] {
      ParallelTasks(2, 4, [&](size_t task) {
        // Every caller is inside of its region before one leaves it.
        if (task == 0) {
          ++inside;
          if (!Reaches(inside, kNumCallers)) ++alone;
        }
        ++count;
      });
      for (int region = 0; region < 200; ++region) ParallelTasks(3, 5, [&](size_t) { ++count; });
    });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(count.load(), kNumCallers * (4 + 200 * 5));
  EXPECT_EQ(alone.load(), 0);
}

TEST(ParallelTasks, AnExceptionReachesItsOwnCaller) {
  std::atomic<int> wrong = 0;
  const auto work = [&](const std::string& name) {
    for (int i = 0; i < 200; ++i) {
      try {
        ParallelTasks(2, 6, [&](size_t task) {
          if (task == 3) throw std::runtime_error(name);
        });
        ++wrong;
      } catch (const std::runtime_error& error) {
        if (error.what() != name) ++wrong;
      }
    }
  };
  std::thread other(work, "other");
  work("this");
  other.join();
  EXPECT_EQ(wrong.load(), 0);
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
