#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Relative poses of generated pairs of views with wrong matches: `holba bench --benchmark two_view` beside PoseLib and
OpenCV's USAC (PyPI: numpy, poselib, opencv-python-headless; what is not there is left out). Prints a Markdown table of
successes (share of pairs whose rotation and direction of translation are both within --success_deg), mean average
accuracy (area under the recall of the larger of both errors up to 10 degrees) and time for each kind of scene.

Pairs: 500 matches in 800 x 600 pixels, f = 700 px, depths 3 to 9, baseline 1 unless small (0.2), Gaussian noise on
both ends, wrong matches uniform in both pictures. All programs get the same pairs, the largest error --max_error px,
99.9 % confidence and up to --max_samples samples. The order of the matches means nothing.
Example: benchmark/two_view.py --holba build/bin/holba --pairs 100
"""

import argparse
import time

import numpy as np

from bench_poses import bench_poses

try:
    import poselib
except ImportError:
    poselib = None
try:
    import cv2
except ImportError:
    cv2 = None

WIDTH, HEIGHT, FOCAL = 800, 600, 700.0
K = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
NUM_MATCHES = 500
KINDS = {
    "general": {},
    "planar": {"planar": True},
    "small baseline": {"baseline": 0.2},
    "forward": {"forward": True},
}


def rotation(vector):
    angle = np.linalg.norm(vector)
    axis = vector / angle
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def unit(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def make_pair(rng, noise_px, wrong, planar=False, forward=False, baseline=1.0):
    """(x1, x2, R, t): pixels (n, 2) of both views and the pose cam2_from_cam1."""
    if forward:
        R = rotation(0.02 * unit(rng))
        t = np.array([0, 0, -1.0]) + 0.05 * unit(rng)
    else:
        R = rotation(rng.uniform(0.05, 0.3) * unit(rng))
        t = unit(rng) * [1, 1, 0.3]
    t /= np.linalg.norm(t)
    normal = np.array([rng.uniform(-0.4, 0.4), rng.uniform(-0.4, 0.4), 1.0])
    num_right = NUM_MATCHES - round(wrong * NUM_MATCHES)
    x1, x2 = [], []
    while len(x1) < num_right:
        pixel = rng.uniform([0, 0], [WIDTH, HEIGHT])
        ray = np.array([(pixel[0] - K[0, 2]) / FOCAL, (pixel[1] - K[1, 2]) / FOCAL, 1.0])
        depth = 6.0 / (ray @ normal) if planar else rng.uniform(3, 9)
        if not 0.5 < depth < 40:
            continue
        X = R @ (depth * ray) + baseline * t
        if X[2] <= 0:
            continue
        other = (K @ X)[:2] / X[2]
        if not (0 < other[0] < WIDTH and 0 < other[1] < HEIGHT):
            continue
        x1.append(pixel + rng.normal(scale=noise_px, size=2))
        x2.append(other + rng.normal(scale=noise_px, size=2))
    for _ in range(NUM_MATCHES - num_right):
        x1.append(rng.uniform([0, 0], [WIDTH, HEIGHT]))
        x2.append(rng.uniform([0, 0], [WIDTH, HEIGHT]))
    order = rng.permutation(NUM_MATCHES)
    return np.array(x1)[order], np.array(x2)[order], R, t


def run_holba(args, pairs):
    return bench_poses(args.holba, "two_view", "pair", [WIDTH, HEIGHT, FOCAL, FOCAL, K[0, 2], K[1, 2]],
                       [np.hstack([x1, x2]) for x1, x2, _, _ in pairs], "%.9f",
                       ["--TwoViewGeometry.max_error", str(args.max_error), "--TwoViewGeometry.min_inlier_ratio", "0.05",
                        "--TwoViewGeometry.max_num_trials", str(args.max_samples)])


def run_poselib(args, pairs):
    camera = {"model": "PINHOLE", "width": WIDTH, "height": HEIGHT, "params": [FOCAL, FOCAL, K[0, 2], K[1, 2]]}
    options = {"max_iterations": args.max_samples, "success_prob": 0.999, "max_epipolar_error": args.max_error,
               "max_error": args.max_error}
    poses, times = [], []
    for x1, x2, _, _ in pairs:
        begin = time.process_time()
        pose, _ = poselib.estimate_relative_pose(x1, x2, camera, camera, options, {})
        times.append(1e6 * (time.process_time() - begin))
        pose = getattr(pose, "pose", pose)
        poses.append((np.array(pose.R), np.array(pose.t)))
    return poses, times


def run_usac(args, pairs):
    poses, times = [], []
    for x1, x2, _, _ in pairs:
        begin = time.process_time()
        pose = None
        E, mask = cv2.findEssentialMat(x1, x2, K, cv2.USAC_MAGSAC, 0.999, args.max_error, args.max_samples)
        if E is not None and E.shape[0] >= 3:
            _, R, t, _ = cv2.recoverPose(E[:3], x1, x2, K, mask=mask)
            pose = (R, t.ravel())
        times.append(1e6 * (time.process_time() - begin))
        poses.append(pose)
    return poses, times


def error_deg(pose, R, t):
    if pose is None:
        return 180.0
    cosine = np.clip((np.trace(pose[0].T @ R) - 1) / 2, -1, 1)
    length = np.linalg.norm(pose[1])
    if length == 0:
        return 180.0
    direction = np.clip(pose[1] @ t / length, -1, 1)
    return max(np.degrees(np.arccos(cosine)), np.degrees(np.arccos(direction)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--holba", default="build/bin/holba")
    parser.add_argument("--pairs", type=int, default=50, help="of each kind, noise and share of wrong matches")
    parser.add_argument("--noise_px", default="0.5,1,2")
    parser.add_argument("--wrong", default="0.1,0.5,0.8,0.9")
    parser.add_argument("--max_error", type=float, default=4.0)
    parser.add_argument("--max_samples", type=int, default=10000)
    parser.add_argument("--success_deg", type=float, default=5.0)
    args = parser.parse_args()

    programs = {"holba": run_holba}
    if poselib is not None:
        programs["PoseLib"] = run_poselib
    if cv2 is not None:
        cv2.setNumThreads(1)
        programs["USAC"] = run_usac
    print("| scene | noise px | wrong | " + " | ".join(f"{p}: success, accuracy, ms" for p in programs) + " |")
    print("| --- | ---: | ---: |" + " --- |" * len(programs))
    rng = np.random.default_rng(1)
    for kind, options in KINDS.items():
        for noise_px in map(float, args.noise_px.split(",")):
            for wrong in map(float, args.wrong.split(",")):
                pairs = [make_pair(rng, noise_px, wrong, **options) for _ in range(args.pairs)]
                cells = []
                for function in programs.values():
                    poses, times = function(args, pairs)
                    errors = np.array([error_deg(pose, R, t) for pose, (_, _, R, t) in zip(poses, pairs)])
                    accuracy = np.mean(np.clip(1 - errors / 10, 0, 1))
                    cells.append(f"{100 * np.mean(errors < args.success_deg):.0f} %, {100 * accuracy:.1f}, "
                                 f"{np.mean(times) / 1000:.2f}")
                print(f"| {kind} | {noise_px:g} | {100 * wrong:.0f} % | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
