// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/blas_setup.h"

#include <algorithm>
#include <array>

#if defined(__linux__) && defined(__x86_64__)
#include <dlfcn.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "holba/base/log.h"
#endif

namespace holba {

std::string BetterBlasCore(std::string_view core_name, const CpuFeatures& cpu) {
  // OpenBLAS' x86-64 cores without AVX (its cpuid_x86.c and driver/others/dynamic.c).
  static constexpr std::array<std::string_view, 12> kWithoutAvx = {
      "Prescott", "Core2",        "Penryn",    "Dunnington", "Nehalem", "Athlon",
      "Opteron",  "Opteron_SSE3", "Barcelona", "Bobcat",     "Atom",    "Nano"};
  if (std::find(kWithoutAvx.begin(), kWithoutAvx.end(), core_name) == kWithoutAvx.end()) return "";
  if (cpu.avx512) return "SKYLAKEX";
  if (cpu.avx2) return "HASWELL";
  return "";
}

#if defined(__linux__) && defined(__x86_64__)
namespace {

// The program's arguments as it was started, for exec.
std::vector<std::string> OwnArguments() {
  std::vector<std::string> arguments;
  if (FILE* file = std::fopen("/proc/self/cmdline", "rb")) {
    std::string current;
    for (int c = std::fgetc(file); c != EOF; c = std::fgetc(file)) {
      if (c == 0) {
        arguments.push_back(std::move(current));
        current.clear();
      } else {
        current.push_back(static_cast<char>(c));
      }
    }
    std::fclose(file);
  }
  return arguments;
}

CpuFeatures ThisCpu() {
  __builtin_cpu_init();
  CpuFeatures cpu;
  cpu.avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  cpu.avx512 = cpu.avx2 && __builtin_cpu_supports("avx512f") &&
               __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
               __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
  return cpu;
}

}  // namespace

void SetUpBlas() {
  // Looked up at run time: holba itself calls no BLAS and does not link it.
  using GetCoreName = char*();
  using SetNumThreads = void(int);
  const auto get_core_name =
      reinterpret_cast<GetCoreName*>(dlsym(RTLD_DEFAULT, "openblas_get_corename"));
  if (get_core_name == nullptr) return;

  if (std::getenv("OPENBLAS_NUM_THREADS") == nullptr && std::getenv("OMP_NUM_THREADS") == nullptr &&
      std::getenv("GOTO_NUM_THREADS") == nullptr) {
    setenv("OPENBLAS_NUM_THREADS", "1", 1);  // for a new start
    const auto set_num_threads =
        reinterpret_cast<SetNumThreads*>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"));
    if (set_num_threads != nullptr) set_num_threads(1);
  }

  if (std::getenv("OPENBLAS_CORETYPE") != nullptr) return;
  const std::string core = BetterBlasCore(get_core_name(), ThisCpu());
  if (core.empty()) return;
  std::vector<std::string> arguments = OwnArguments();
  if (arguments.empty()) return;
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  setenv("OPENBLAS_CORETYPE", core.c_str(), 1);
  execv("/proc/self/exe", pointers.data());
  // Still here: it could not be started anew. Slower, not wrong.
  unsetenv("OPENBLAS_CORETYPE");
  LogDebug("Could not start anew with OPENBLAS_CORETYPE={}: {}", core, std::strerror(errno));
}
#else
void SetUpBlas() {}
#endif

}  // namespace holba
