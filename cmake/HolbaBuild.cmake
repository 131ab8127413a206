# SPDX-License-Identifier: BSD-3-Clause
# How every room, test and program of holba is built: one place for flags and conventions.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type." FORCE)
endif()

find_program(HOLBA_CCACHE ccache)
if(HOLBA_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${HOLBA_CCACHE})
  if(HOLBA_PRECOMPILE_HEADERS)
    # Without these two ccache passes on every file that uses a precompiled header. No file here uses __TIME__.
    set(CMAKE_CXX_COMPILER_LAUNCHER
        ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${HOLBA_CCACHE})
  endif()
endif()
find_program(HOLBA_MOLD mold)
if(HOLBA_MOLD AND CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
  add_link_options(-fuse-ld=mold)
endif()

set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

# No -march=native: Debian's Ceres is a baseline build and must not exchange wider Eigen objects with us.
add_compile_options(-Wall -Wextra -Wno-unused-parameter -Wno-missing-field-initializers -fno-math-errno)
# Formulas on doubles and on packs of them (simd/lanes.h) combine conditions with &.
add_compile_options($<$<CXX_COMPILER_ID:Clang>:-Wno-bitwise-instead-of-logical>)
if(HOLBA_SANITIZE)
  add_compile_options(-fsanitize=address,undefined -fno-omit-frame-pointer)
  add_link_options(-fsanitize=address,undefined)
endif()
if(HOLBA_BUILD_FUZZERS)
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    message(FATAL_ERROR "HOLBA_BUILD_FUZZERS needs clang: cmake --preset fuzz")
  endif()
  # Coverage in the libraries too; only the fuzzers themselves get libFuzzer's main.
  add_compile_options(-fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all)
  add_link_options(-fsanitize=address,undefined)
endif()

# holba_precompile(TIER [GTEST] [OPTIMISE_LOOPS] HEADERS...): precompiled headers for the rooms of this tier, for those
# with OPTIMISE_LOOPS (gcc takes the optimisation of the header, not that of the file), or for their tests.
# Most of the time of a small file goes into these headers and the templates that they instantiate.
function(holba_precompile tier)
  cmake_parse_arguments(ARG "GTEST;OPTIMISE_LOOPS" "" "HEADERS" ${ARGN})
  # Something to belong to: of the kind of its users, as -fPIC and -fPIE count, too.
  set(carrier ${CMAKE_CURRENT_BINARY_DIR}/precompiled_${tier}.cc)
  file(CONFIGURE OUTPUT ${carrier} CONTENT "int main() {}\n")
  if(ARG_GTEST)
    add_executable(holba_precompiled_${tier} ${carrier})
  else()
    add_library(holba_precompiled_${tier} OBJECT ${carrier})
  endif()
  target_include_directories(holba_precompiled_${tier} PRIVATE ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(holba_precompiled_${tier} PRIVATE Eigen3::Eigen fmt::fmt)
  if(ARG_GTEST)
    target_link_libraries(holba_precompiled_${tier} PRIVATE GTest::gmock GTest::gtest)
  endif()
  if(ARG_OPTIMISE_LOOPS)
    target_compile_options(holba_precompiled_${tier} PRIVATE $<$<CONFIG:Release>:-O3>)
  endif()
  # gcc takes an old precompiled header for the headers it was made from, also while it makes the new one, and what
  # ccache then remembers belongs to the old one: that has to be gone first.
  if(CMAKE_HOST_UNIX)
    set(anew ${CMAKE_BINARY_DIR}/precompile_anew.sh)
    file(CONFIGURE OUTPUT ${anew} CONTENT [[
previous=
for argument in "$@"; do
  case "$previous $argument" in "-o "*.gch) rm -f "$argument" ;; esac
  previous=$argument
done
exec "$@"
]] @ONLY)
    set_target_properties(holba_precompiled_${tier} PROPERTIES
        CXX_COMPILER_LAUNCHER "sh;${anew};${CMAKE_CXX_COMPILER_LAUNCHER}")
  endif()
  list(TRANSFORM ARG_HEADERS REPLACE "(.+)" "<\\1>")
  target_precompile_headers(holba_precompiled_${tier} PRIVATE ${ARG_HEADERS})
endfunction()

# holba_use_precompiled(TARGET TIER): nothing where there is no such tier.
function(holba_use_precompiled target tier)
  if(TARGET holba_precompiled_${tier})
    target_precompile_headers(${target} REUSE_FROM holba_precompiled_${tier})
  endif()
endfunction()

# Two tiers: rooms that see `scene`, rooms that see `geometry`. A header of the project that changes often does not
# belong here: each change compiles the whole tier.
if(HOLBA_PRECOMPILE_HEADERS)
  set(holba_std_headers algorithm array cmath cstdint filesystem functional limits map memory numbers numeric optional
      set span string string_view utility vector)
  set(holba_geometry_headers ${holba_std_headers} Eigen/Core Eigen/Geometry Eigen/Cholesky Eigen/Eigenvalues fmt/format.h
      holba/geometry/line.h holba/geometry/manifold.h)
  set(holba_scene_headers ${holba_geometry_headers} holba/scene/reconstruction.h)
  foreach(tier geometry scene)
    holba_precompile(${tier} HEADERS ${holba_${tier}_headers})
    if(HOLBA_BUILD_TESTS)
      holba_precompile(${tier}_test GTEST HEADERS ${holba_${tier}_headers} gmock/gmock.h gtest/gtest.h)
    endif()
  endforeach()
  holba_precompile(scene_loops OPTIMISE_LOOPS HEADERS ${holba_scene_headers})
endif()

# holba_unite(TARGET): with HOLBA_UNITY_BUILD its files are compiled several at a time, which parses headers and
# instantiates templates once for all of them. Sources with options of their own stay apart (CMake sees to it). Eight
# at once take the same time and 1.7 GB of memory, more than holba_jobs (setup.sh) counts on; four stay below that.
function(holba_unite target)
  if(HOLBA_UNITY_BUILD)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 4)
  endif()
endfunction()

# Compiler flags of the instruction sets of simd/targets.h. Contraction to fused multiply-add is what they are for.
set(holba_simd_flags_scalar -DHOLBA_SIMD_SCALAR)
set(holba_simd_flags_vec128 -DHOLBA_SIMD_BYTES=16)
set(holba_simd_flags_vec256 -DHOLBA_SIMD_BYTES=32 -mavx2 -mfma)
set(holba_simd_flags_vec512 -DHOLBA_SIMD_BYTES=64 -mavx512f -mavx512dq -mavx512vl -mavx2 -mfma)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  set(holba_simd_targets scalar vec128 vec256 vec512)
else()
  set(holba_simd_targets scalar vec128)
endif()

# Sets `out` to one source for each X_simd.cc and instruction set.
function(holba_simd_sources out)
  set(made)
  foreach(source ${ARGN})
    get_filename_component(stem ${source} NAME_WE)
    foreach(target ${holba_simd_targets})
      # The scalar form is a reference for tests and for processors without vectors: it need not be fast.
      set(level -O3)
      if(target STREQUAL "scalar")
        set(level -O1)
      endif()
      set(wrapper ${CMAKE_CURRENT_BINARY_DIR}/${stem}_${target}.cc)
      file(CONFIGURE OUTPUT ${wrapper} CONTENT "#include \"${source}\"\n")
      set_source_files_properties(${wrapper} PROPERTIES SKIP_PRECOMPILE_HEADERS ON COMPILE_OPTIONS
        "-DHOLBA_SIMD_TARGET=${target};${holba_simd_flags_${target}};${level};-ffp-contract=fast;-fno-trapping-math;-Wno-psabi;$<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>;$<$<CXX_COMPILER_ID:GNU>:-fno-var-tracking>")
      list(APPEND made ${wrapper})
    endforeach()
  endforeach()
  set(${out} ${made} PARENT_SCOPE)
endfunction()

# holba_room(NAME [EXCLUDE regex] [OPTIMISE_LOOPS] [DEPENDS rooms...] [PUBLIC libs...] [PRIVATE libs...])
# The library holba_NAME of this folder's *.cc; each *_test.cc becomes a ctest named NAME/<file>, each
# *_fuzz.cc a libFuzzer program fuzz/NAME_<file>; each *_simd.cc is compiled once for each instruction set
# (X_testing_simd.cc into X_test alone). NAME is the path below src/holba: of a sub-room "estimation/lines", whose
# library is holba_estimation_lines. OPTIMISE_LOOPS: for loops over pixels and pairs of features, which gcc
# vectorises at -O2 only where their length is known.
function(holba_room path)
  cmake_parse_arguments(ARG "OPTIMISE_LOOPS" "EXCLUDE" "DEPENDS;PUBLIC;PRIVATE" ${ARGN})
  string(REPLACE "/" "_" name ${path})
  list(TRANSFORM ARG_DEPENDS REPLACE "/" "_")
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cc)
  if(ARG_EXCLUDE)
    list(FILTER sources EXCLUDE REGEX ${ARG_EXCLUDE})
  endif()
  set(tests ${sources})
  set(fuzzers ${sources})
  set(simd_sources ${sources})
  list(FILTER sources EXCLUDE REGEX "_(test|fuzz|simd)\\.cc$")
  list(FILTER simd_sources INCLUDE REGEX "_simd\\.cc$")
  list(FILTER simd_sources EXCLUDE REGEX "_testing_simd\\.cc$")
  holba_simd_sources(simd_sources ${simd_sources})
  list(APPEND sources ${simd_sources})
  list(FILTER tests INCLUDE REGEX "_test\\.cc$")
  list(FILTER fuzzers INCLUDE REGEX "_fuzz\\.cc$")
  list(TRANSFORM ARG_DEPENDS PREPEND holba_)
  if(sources)
    add_library(holba_${name} STATIC ${sources})
    set(scope PUBLIC)
  else()
    add_library(holba_${name} INTERFACE)
    set(scope INTERFACE)
  endif()
  add_library(holba::${name} ALIAS holba_${name})
  set_target_properties(holba_${name} PROPERTIES EXPORT_NAME ${name})
  target_compile_features(holba_${name} ${scope} cxx_std_20)
  target_include_directories(holba_${name} ${scope}
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(holba_${name} ${scope} ${ARG_DEPENDS} ${ARG_PUBLIC})
  if(ARG_PRIVATE AND sources)
    target_link_libraries(holba_${name} PRIVATE ${ARG_PRIVATE})
  endif()
  # The highest tier of precompiled headers that this room or one below it belongs to.
  set(tier "")
  foreach(candidate geometry scene)
    if(name STREQUAL candidate)
      set(tier ${candidate})
    endif()
    foreach(below ${ARG_DEPENDS})
      get_target_property(tier_below ${below} HOLBA_TIER)
      if(tier_below STREQUAL candidate)
        set(tier ${candidate})
      endif()
    endforeach()
  endforeach()
  set_target_properties(holba_${name} PROPERTIES HOLBA_TIER "${tier}")
  if(sources AND ARG_OPTIMISE_LOOPS)
    holba_use_precompiled(holba_${name} "${tier}_loops")
  elseif(sources)
    holba_use_precompiled(holba_${name} "${tier}")
  endif()
  if(sources)
    holba_unite(holba_${name})
  endif()
  if(ARG_OPTIMISE_LOOPS AND sources)
    target_compile_options(holba_${name} PRIVATE $<$<CONFIG:Release>:-O3>)
  endif()
  set_property(GLOBAL APPEND PROPERTY HOLBA_ROOMS ${name})
  if(HOLBA_BUILD_TESTS)
    foreach(test ${tests})
      get_filename_component(stem ${test} NAME_WE)
      set(test_sources ${test})
      string(REGEX REPLACE "_test\\.cc$" "_testing_simd.cc" helper ${test})
      if(EXISTS ${helper})
        holba_simd_sources(helpers ${helper})
        list(APPEND test_sources ${helpers})
      endif()
      holba_test(${path}/${stem} SOURCES ${test_sources} LINK holba_${name})
    endforeach()
  endif()
  if(HOLBA_BUILD_FUZZERS)
    foreach(fuzzer ${fuzzers})
      get_filename_component(stem ${fuzzer} NAME_WE)
      add_executable(${name}_${stem} ${fuzzer})
      target_link_libraries(${name}_${stem} PRIVATE holba_${name})
      target_link_options(${name}_${stem} PRIVATE -fsanitize=fuzzer)
      set_target_properties(${name}_${stem} PROPERTIES
                            RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/fuzz)
    endforeach()
  endif()
endfunction()

# holba_test(room/name SOURCES files... LINK targets...): a GoogleTest program known to ctest.
function(holba_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK;ARGS" ${ARGN})
  string(REPLACE "/" "_" target ${name})
  add_executable(${target} ${ARG_SOURCES})
  target_link_libraries(${target} PRIVATE ${ARG_LINK} GTest::gmock GTest::gtest GTest::gtest_main)
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  list(GET ARG_LINK 0 tested)
  get_target_property(tier ${tested} HOLBA_TIER)
  holba_use_precompiled(${target} "${tier}_test")
  add_test(NAME ${name} COMMAND ${target} ${ARG_ARGS})
  set_tests_properties(${name} PROPERTIES TIMEOUT 600)
endfunction()

# holba_test_on_ranks(room/name [DISABLED names...]): runs this test under mpirun with 2, 3 and 4 ranks, too, on a
# machine of fewer cores and as root in a container as well (docs/mpi.md). DISABLED: instances of disabled tests, each of
# which gets processes of its own, three of them.
function(holba_test_on_ranks name)
  cmake_parse_arguments(ARG "" "" "DISABLED" ${ARGN})
  string(REPLACE "/" "_" target ${name})
  foreach(ranks 2 3 4)
    set(run ${MPIEXEC_EXECUTABLE} --oversubscribe ${MPIEXEC_NUMPROC_FLAG} ${ranks} $<TARGET_FILE:${target}>)
    set(tests ${name}_${ranks})
    add_test(NAME ${name}_${ranks} COMMAND ${run})
    foreach(instance ${ARG_DISABLED})
      if(NOT ranks EQUAL 3)
        continue()
      endif()
      list(APPEND tests ${name}_${ranks}_${instance})
      add_test(NAME ${name}_${ranks}_${instance}
               COMMAND ${run} --gtest_also_run_disabled_tests --gtest_filter=*DISABLED*/${instance})
    endforeach()
    set_tests_properties(${tests} PROPERTIES TIMEOUT 600 PROCESSORS 2 ENVIRONMENT
      "OMPI_ALLOW_RUN_AS_ROOT=1;OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1;OMPI_MCA_btl_base_warn_component_unused=0")
  endforeach()
endfunction()

# Folder of real image sets and adjustment problems; tests that need it are skipped, and say so, where it is missing.
set(HOLBA_DATA_DIR ${PROJECT_SOURCE_DIR}/../shared/data CACHE PATH "Folder of real data for the tests.")

# holba_test_data(tests...): these tests include holba/base/data_testing.h.
function(holba_test_data)
  foreach(test ${ARGN})
    if(TARGET ${test})
      target_compile_definitions(${test} PRIVATE HOLBA_CONFIGURED_DATA_DIR="${HOLBA_DATA_DIR}")
    endif()
  endforeach()
endfunction()

# Installs every room, its headers and a package config: find_package(holba), link holba::holba.
function(holba_install_package)
  get_property(rooms GLOBAL PROPERTY HOLBA_ROOMS)
  set(targets ${rooms})
  list(TRANSFORM targets PREPEND holba_)
  add_library(holba_holba INTERFACE)
  set_target_properties(holba_holba PROPERTIES EXPORT_NAME holba)
  target_link_libraries(holba_holba INTERFACE ${targets})
  add_library(holba::holba ALIAS holba_holba)
  install(TARGETS holba_holba ${targets} EXPORT holbaTargets
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development
          LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/holba DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development
          FILES_MATCHING PATTERN "*.h" PATTERN fuzz EXCLUDE
          # Helpers of tests stay here.
          PATTERN "*_testing.h" EXCLUDE PATTERN test_scenes.h EXCLUDE
          # Shows OpenCV to its users, which the package does not look for.
          PATTERN sift_scale_space.h EXCLUDE PATTERN sift_descriptor.h EXCLUDE
          PATTERN test_models.h EXCLUDE PATTERN random_model.h EXCLUDE PATTERN camera_examples.h EXCLUDE)
  install(EXPORT holbaTargets NAMESPACE holba:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/holba COMPONENT development)
  configure_package_config_file(
    ${PROJECT_SOURCE_DIR}/cmake/holbaConfig.cmake.in ${CMAKE_BINARY_DIR}/holbaConfig.cmake
    INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/holba)
  write_basic_package_version_file(${CMAKE_BINARY_DIR}/holbaConfigVersion.cmake
                                   COMPATIBILITY SameMinorVersion)
  install(FILES ${CMAKE_BINARY_DIR}/holbaConfig.cmake ${CMAKE_BINARY_DIR}/holbaConfigVersion.cmake
          DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/holba COMPONENT development)
endfunction()
