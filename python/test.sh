#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Builds the Python package and runs its tests. Arguments go to ctest. HOLBA_PYTHON: the Python that the virtual
# environment is made of (python3).
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../cmake/setup.sh"
holba_install_packages "${holba_build_packages[@]}" python3-dev python3-venv
environment=$holba_build/python_environment
if [[ ! -x $environment/bin/pytest ]]; then
  "${HOLBA_PYTHON:-python3}" -m venv "$environment" >&2
  "$environment/bin/pip" install --quiet 'nanobind>=3.1' 'numpy>=1.22' 'typing_extensions>=4.5' scipy pytest 'mypy>=1.8' >&2
  # Without it (no wheel for this Python) the tests of its objects say that they are skipped.
  "$environment/bin/pip" install --quiet 'pycolmap>=3.12' >&2 || true
fi
HOLBA_TARGETS="holba holba_python_package" \
  holba_configure_and_build -DHOLBA_BUILD_TESTS=ON -DHOLBA_BUILD_PYTHON=ON -DPython_EXECUTABLE="$environment/bin/python"
exec ctest --test-dir "$holba_build" --output-on-failure -R '^python/' -j "$(nproc)" "$@"
