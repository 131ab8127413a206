#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs a Debian package into a root file system that has nothing but apt, and runs the program there: a synthetic
# scene is adjusted and photographs that it renders are reconstructed. Needs root, mmdebstrap and Debian's archive.
# Usage: cmake/test_package.sh holba_VERSION_amd64.deb [ROOT], ROOT: such a root that is there already.
set -euo pipefail
package=$(realpath "$1")
root=${2:-}
if [[ -z $root ]]; then
  root=$(mktemp -d)/root
  trap 'rm -rf "$(dirname "$root")"' EXIT
  echo "Making a root file system with apt alone" >&2
  options=()
  # The archives and settings of this system.
  for file in /etc/apt/apt.conf.d/99*; do [[ -f $file ]] && options+=("--aptopt=$file"); done
  sources=(/etc/apt/sources.list.d/debian.sources)
  [[ -f ${sources[0]} ]] || sources=(/etc/apt/sources.list)
  mmdebstrap --quiet --variant=apt "${options[@]}" "$(. /etc/os-release && echo "$VERSION_CODENAME")" "$root" "${sources[@]}"
fi
cp "$package" "$root/tmp/holba.deb"
inside() { chroot "$root" env DEBIAN_FRONTEND=noninteractive HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"; }
if [[ -e $root/usr/bin/holba ]]; then echo "$root has holba already" >&2; exit 1; fi
inside apt-get update -q >/dev/null
inside apt-get install -q -y --no-install-recommends /tmp/holba.deb >"$root/tmp/apt.log" 2>&1 ||
  { tail -20 "$root/tmp/apt.log" >&2; exit 1; }
inside holba --version
inside holba synthesize --output_path /tmp/scene --num_images 20 --seed 1 --quiet
inside holba adjust --input_path /tmp/scene/perturbed --output_path /tmp/adjusted --quiet >/dev/null
inside holba evaluate --input_path /tmp/adjusted --ground_truth_path /tmp/scene/truth --quiet | grep rotation_rms
if inside holba help | grep -q reconstruct; then
  inside holba render --output_path /tmp/room --quiet
  inside holba reconstruct --image_path /tmp/room/images --output_path /tmp/model --quiet >/dev/null
  inside holba evaluate_poses --input_path /tmp/model/0 --ground_truth_path /tmp/room/truth | head -2
fi
# Completion works in a shell of its own; the manual pages are there.
inside bash -c 'source /usr/share/bash-completion/completions/holba
COMP_WORDS=(holba adjust --Solver.back) COMP_CWORD=2; _holba; [[ ${COMPREPLY[*]} == --Solver.backend ]]'
inside test -s /usr/share/man/man1/holba-adjust.1
inside apt-get remove -q -y holba >/dev/null 2>&1
if inside test -e /usr/bin/holba; then echo "The package left the program behind" >&2; exit 1; fi
echo "The package installs, runs and goes: $(basename "$package")"
