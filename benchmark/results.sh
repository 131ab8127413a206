#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Makes docs/results/*.json, their plots and docs/results.md anew: the paper's tables and figures by `holba bench`.
# Usage: benchmark/results.sh [PROGRAM] [BENCHMARK ...] (default: build/bin/holba, all). WORK names a folder where rendered
# places stay for the next run; processor time of one thread is measured, so that other work on the machine matters little.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
holba=${1:-$root/build/bin/holba}
[ $# -eq 0 ] || shift
[ $# -gt 0 ] || set -- scaling wireframe breakdown sfm density geometry poses ablation primitives
results=$root/docs/results
work=${WORK:-$root/build/bench_work}
export OPENBLAS_NUM_THREADS=1
for benchmark in "$@"; do
  case $benchmark in
    scaling | wireframe) options="--clock cpu --iterations 6 --repetitions 1 --num_images 50,100,200" ;;
    sfm | breakdown) options="--scene collection --structures none,lines,holistic --num_images 30" ;;
    density) options="--num_images 100" ;;
    *) options="" ;;
  esac
  # shellcheck disable=SC2086
  "$holba" bench --benchmark "$benchmark" $options --work_path "$work" --output_path "$results" > /dev/null
done
"$holba" bench --benchmark report --input_path "$results" --output_path "$root/docs/results.md"
