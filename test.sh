#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs what is missing, builds everything and runs all tests. Arguments go to ctest: ./test.sh -R io/
# With --all the Python package (python/test.sh) and the optional parts of the build (HOLBA_WITH_PETSC) with what these
# need are built and tested, too: some minutes more.
set -euo pipefail
all=no
if [[ ${1:-} == --all ]]; then
  shift
  all=yes
  "$(dirname "${BASH_SOURCE[0]}")/python/test.sh" "$@"
fi
source "$(dirname "${BASH_SOURCE[0]}")/cmake/setup.sh"
holba_install_packages "${holba_build_packages[@]}" "${holba_test_packages[@]}"
options=(-DHOLBA_BUILD_TESTS=ON)
if [[ $all == yes ]]; then
  if holba_install_packages "${holba_optional_packages[@]}"; then
    options+=(-DHOLBA_WITH_PETSC=ON)
  else
    echo "No ${holba_optional_packages[*]}: the backend petsc is neither built nor tested." >&2
  fi
fi
# What tests the viewer: any Node, npm and chromium that are there will do. Without them those tests say that they are skipped.
viewer_packages=()
command -v node >/dev/null || viewer_packages+=(nodejs)
command -v npm >/dev/null || viewer_packages+=(npm)
command -v chromium >/dev/null || command -v chromium-browser >/dev/null || command -v google-chrome >/dev/null ||
  viewer_packages+=(chromium)
if ((${#viewer_packages[@]} > 0)); then
  holba_install_packages "${viewer_packages[@]}" || echo "No ${viewer_packages[*]}: tests of the viewer are skipped." >&2
fi
holba_configure_and_build "${options[@]}"
# The tests of ONNX models need a runtime, which only PyPI has for Debian 12. Without it they say that they are skipped.
holba_find_onnxruntime() {
  compgen -G "$holba_build/onnxruntime/lib/python3*/site-packages/onnxruntime/capi/libonnxruntime.so*" | head -n 1
}
if [[ -z ${HOLBA_ONNXRUNTIME:-} ]]; then
  library=$(holba_find_onnxruntime || true)
  if [[ -z $library ]]; then
    { python3 -m venv "$holba_build/onnxruntime" &&
      "$holba_build/onnxruntime/bin/pip" install --quiet 'onnxruntime>=1.14'; } >&2 ||
      echo "No ONNX Runtime from PyPI: the tests of ONNX models are skipped." >&2
    library=$(holba_find_onnxruntime || true)
  fi
  if [[ -n $library ]]; then export HOLBA_ONNXRUNTIME=$library; fi
fi
# LIMAP itself reads our files and writes them back, where PyPI has it. Its wheel names a whole front end among what it
# needs, which reading files does not.
if [[ -z ${HOLBA_PYLIMAP:-} ]]; then
  pylimap=$holba_build/pylimap
  if ! "$pylimap/bin/python" -c 'import limap' >/dev/null 2>&1; then
    { python3 -m venv "$pylimap" &&
      "$pylimap/bin/pip" install --quiet --no-deps pylimap==2.0.0 pycolmap==4.2.0 'numpy>=1.26'; } >&2 ||
      echo "No pylimap 2.0.0 from PyPI: the test limap/round_trip is skipped." >&2
  fi
  if "$pylimap/bin/python" -c 'import limap' >/dev/null 2>&1; then export HOLBA_PYLIMAP=$pylimap/bin/python; fi
fi
exec ctest --test-dir "$holba_build" --output-on-failure -j "$(nproc)" "$@"
