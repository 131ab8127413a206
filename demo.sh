#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs what is missing, builds holba, and shows what it is for: photographs of a small room, which it draws
# itself, become cameras, points, lines and planes, with a picture of them; and what structure buys: a synthetic
# scene is adjusted four times, each time with more of its structure, and every result is compared with the truth.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/cmake/setup.sh"
holba_install_packages "${holba_build_packages[@]}"
HOLBA_TARGETS=holba holba_configure_and_build

holba=$holba_build/bin/holba
work=$holba_build/demo
rm -rf "$work"
mkdir -p "$work"

echo "Photographs in, a reconstruction out: holba reconstruct --image_path images --output_path model" >&2
"$holba" render --output_path "$work/room" --quiet
"$holba" reconstruct --image_path "$work/room/images" --output_path "$work/model"
echo "Against the true cameras, which the photographs do not tell:"
"$holba" evaluate_poses --input_path "$work/model/0" --ground_truth_path "$work/room/truth"
echo

"$holba" synthesize --output_path "$work/scene" --num_images 50 --seed 1 --quiet
evaluate() {
  "$holba" evaluate --input_path "$1" --ground_truth_path "$work/scene/truth" --json --quiet
}
evaluate "$work/scene/perturbed" >"$work/start.json"
for config in point point_line groups holistic; do
  echo "Adjusting a synthetic scene with --Bundle.config $config" >&2
  "$holba" adjust --input_path "$work/scene/perturbed" --output_path "$work/$config" \
    --Bundle.config "$config" --quiet >"$work/$config.txt"
  evaluate "$work/$config" >"$work/$config.json"
done
python3 "$holba_root/cmake/demo_table.py" "$work"
"$holba" view --input_path "$work/holistic" --compare_path "$work/scene/truth" --output_path "$work/scene.html" --quiet
echo "The models are in ${work#"$PWD"/}, the photographs of the room in ${work#"$PWD"/}/room/images."
echo "Open these in a browser: ${work#"$PWD"/}/scene.html, the adjusted scene over the truth, and"
echo "${work#"$PWD"/}/model/0/view.html, the room; pictures of it are in ${work#"$PWD"/}/model/0/pictures."
