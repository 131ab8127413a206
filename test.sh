#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs what is missing, builds everything and runs all tests. Arguments go to ctest: ./test.sh -R io/
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/cmake/setup.sh"
holba_install_packages "${holba_build_packages[@]}" "${holba_test_packages[@]}"
# What tests the viewer: any Node, npm and chromium that are there will do. Without them those tests say that they are skipped.
viewer_packages=()
command -v node >/dev/null || viewer_packages+=(nodejs)
command -v npm >/dev/null || viewer_packages+=(npm)
command -v chromium >/dev/null || command -v chromium-browser >/dev/null || command -v google-chrome >/dev/null ||
  viewer_packages+=(chromium)
if ((${#viewer_packages[@]} > 0)); then
  holba_install_packages "${viewer_packages[@]}" || echo "No ${viewer_packages[*]}: tests of the viewer are skipped." >&2
fi
holba_configure_and_build -DHOLBA_BUILD_TESTS=ON
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
exec ctest --test-dir "$holba_build" --output-on-failure -j "$(nproc)" "$@"
