#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sourced by demo.sh and test.sh: from a fresh Debian 12 or Ubuntu 24.04 to a built holba in build/.
# HOLBA_BUILD_DIR=folder builds elsewhere; HOLBA_JOBS=n sets how many compilers run at once.

holba_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
holba_build=${HOLBA_BUILD_DIR:-$holba_root/build}

holba_build_packages=(
  build-essential cmake ninja-build ccache mold git pkg-config
  libeigen3-dev libceres-dev libsuitesparse-dev libmetis-dev libopenblas-dev
  libcli11-dev libspdlog-dev libfmt-dev nlohmann-json3-dev
  libsqlite3-dev libbz2-dev libopencv-features2d-dev libopencv-imgproc-dev libhdf5-dev zlib1g-dev
  libjpeg-dev libpng-dev libtiff-dev libembree-dev
  libgtest-dev libgmock-dev python3 python3-numpy
)
# The outside check of our files, and the compiler of the fuzzers.
holba_test_packages=(colmap clang)

# What ./test.sh --all adds: the backend petsc, for adjustments that many processes share.
holba_optional_packages=(petsc-dev libopenmpi-dev openmpi-bin)

# Installs those of the packages $@ that are missing; nothing, and no rights needed, when all are there.
holba_install_packages() {
  if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    echo "This system has no apt-get. Install the equivalents of: $*" >&2
    return 0
  fi
  local missing=() package
  for package in "$@"; do
    if [[ $(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) != installed ]]; then
      missing+=("$package")
    fi
  done
  if ((${#missing[@]} == 0)); then return 0; fi
  local as_root=()
  if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
      echo "Missing packages, and neither root nor sudo: apt-get install ${missing[*]}" >&2
      return 1
    fi
    as_root=(sudo)
  fi
  echo "Installing the distribution's packages that are missing: ${missing[*]}" >&2
  local install=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive
                 apt-get install -y --no-install-recommends "${missing[@]}")
  # The lists of packages may be absent or out of date: only then are they fetched.
  if ! apt-cache show "${missing[@]}" >/dev/null 2>&1 || ! "${install[@]}" >&2; then
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update >&2
    "${install[@]}" >&2
  fi
}

# Compilers at once: one per core, as long as each finds 1.5 GB of free memory.
holba_jobs() {
  local cores available_mb
  cores=$(nproc)
  available_mb=$(awk '/^MemAvailable:/ {print int($2 / 1024)}' /proc/meminfo)
  local by_memory=$((available_mb / 1500))
  local jobs=$((by_memory < cores ? by_memory : cores))
  echo "${HOLBA_JOBS:-$((jobs > 1 ? jobs : 1))}"
}

# Configures and builds; arguments go to cmake's configure step. $HOLBA_TARGETS: only these.
holba_configure_and_build() {
  # A folder that somebody has configured keeps its generator and its kind of build.
  local fresh=()
  if [[ ! -f $holba_build/CMakeCache.txt ]]; then
    fresh=(-DHOLBA_UNITY_BUILD=ON)
    if command -v ninja >/dev/null; then fresh+=(-G Ninja); fi
  fi
  cmake -S "$holba_root" -B "$holba_build" "${fresh[@]}" "$@" >&2
  local targets=()
  if [[ -n ${HOLBA_TARGETS:-} ]]; then targets=(--target ${HOLBA_TARGETS}); fi
  cmake --build "$holba_build" --parallel "$(holba_jobs)" "${targets[@]}" >&2
}
