# SPDX-License-Identifier: BSD-3-Clause
# Installs the built holba into a folder of its own, then configures, builds and runs this example against
# it, as a project elsewhere would.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    string(REPLACE ";" " " command "${ARGN}")
    message(FATAL_ERROR "'${command}' failed (${status}):\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
run(${CMAKE_COMMAND} --install ${HOLBA_BINARY_DIR} --prefix ${WORK}/installed)
run(${CMAKE_COMMAND} -S ${EXAMPLE} -B ${WORK}/build -G ${GENERATOR}
    -DCMAKE_PREFIX_PATH=${WORK}/installed -DCMAKE_CXX_COMPILER=${COMPILER}
    -DCMAKE_BUILD_TYPE=${BUILD_TYPE} -DCMAKE_CXX_FLAGS=${FLAGS} -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF)
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${WORK}/build/example)
# f (1 + k r^2) x + c with x = (0.2, -0.1), r^2 = 0.05: 500 * 1.0025 * x + (320, 240).
if(NOT output STREQUAL "420.2500 189.8750\n")
  message(FATAL_ERROR "the example printed '${output}'")
endif()
run(${WORK}/installed/bin/holba --version)
string(FIND "${output}" "holba ${HOLBA_VERSION}\n" place)
if(NOT place EQUAL 0)
  message(FATAL_ERROR "the installed program printed '${output}'")
endif()
