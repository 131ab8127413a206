#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Makes dist/holba-VERSION.tar.gz of the commit that is checked out, and SHA256SUMS of all that is in dist; with --deb
# also Debian packages, built from the archive itself, without Ceres (so that they are not under the GPL).
# The same commit gives the same archive. Usage: cmake/make_release.sh [--deb]
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
cd "$holba_root"
if [[ -n $(git status --porcelain) ]]; then
  echo "There are changes that are not committed: a release is of a commit." >&2
  exit 1
fi
version=$(sed -n 's/^project(holba VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
name=holba-$version
dist=${HOLBA_DIST_DIR:-$holba_root/build/dist}
rm -rf "$dist"
mkdir -p "$dist"
# gzip -n: without the time.
git archive --format=tar --prefix="$name/" HEAD | gzip -9n >"$dist/$name.tar.gz"
if [[ ${1:-} == --deb ]]; then
  holba_install_packages "${holba_build_packages[@]}" dpkg-dev
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  tar -xzf "$dist/$name.tar.gz" -C "$work"
  cmake -S "$work/$name" -B "$work/build" -G Ninja -DHOLBA_BUILD_TESTS=OFF -DHOLBA_WITH_CERES=OFF >&2
  cmake --build "$work/build" --parallel "$(holba_jobs)" >&2
  (cd "$dist" && cpack --config "$work/build/CPackConfig.cmake" >&2 && rm -rf _CPack_Packages)
fi
(cd "$dist" && sha256sum -- *.tar.gz $(ls -- *.deb 2>/dev/null) >SHA256SUMS && sha256sum --check --quiet SHA256SUMS)
echo "In ${dist#"$PWD"/}:"
ls -l "$dist"
