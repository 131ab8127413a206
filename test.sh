#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs what is missing, builds everything and runs all tests. Arguments go to ctest: ./test.sh -R io/
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/cmake/setup.sh"
holba_install_packages "${holba_build_packages[@]}" "${holba_test_packages[@]}"
holba_configure_and_build -DHOLBA_BUILD_TESTS=ON
exec ctest --test-dir "$holba_build" --output-on-failure -j "$(nproc)" "$@"
