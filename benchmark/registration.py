#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Poses of generated views from points of which many are wrong: `holba bench --benchmark registration` beside PoseLib
and COLMAP (PyPI: numpy, poselib, pycolmap; what is not there is left out). Prints a Markdown table of successes (share
of views within --success_deg degrees and --success_units units), the median error of the centre in units and the mean
time.

Views: 800 x 600 pixels, f = 700 px, points 3 to 9 units away, Gaussian noise on the pixels, wrong points uniform in the
picture. All programs get the same views, the largest error --max_error px and up to --max_samples samples; all refine
the pose at the end. Example: benchmark/registration.py --holba build/bin/holba --views 100
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
    import pycolmap
except ImportError:
    pycolmap = None

WIDTH, HEIGHT, FOCAL = 800, 600, 700.0
PARAMS = [FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2]


def rotation(vector):
    angle = np.linalg.norm(vector)
    axis = vector / angle
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def make_view(rng, num_points, noise_px, wrong):
    """(X, x, R, t): points (n, 3) and pixels (n, 2), and the pose cam_from_world."""
    R = rotation(rng.uniform(0.1, 3.0) * rng.normal(size=3))
    t = 3 * rng.normal(size=3)
    pixels = rng.uniform([0, 0], [WIDTH, HEIGHT], size=(num_points, 2))
    rays = np.column_stack([(pixels - PARAMS[2:]) / FOCAL, np.ones(num_points)])
    X = (rays * rng.uniform(3, 9, size=(num_points, 1)) - t) @ R
    pixels = pixels + rng.normal(scale=noise_px, size=pixels.shape)
    num_wrong = round(wrong * num_points)
    pixels[:num_wrong] = rng.uniform([0, 0], [WIDTH, HEIGHT], size=(num_wrong, 2))
    order = rng.permutation(num_points)
    return X[order], pixels[order], R, t


def run_holba(args, views):
    return bench_poses(args.holba, "registration", "view", [WIDTH, HEIGHT, FOCAL, FOCAL, PARAMS[2], PARAMS[3]],
                       [np.hstack([X, x]) for X, x, _, _ in views], "%.12g",
                       ["--Mapper.abs_pose_max_error", str(args.max_error), "--Mapper.abs_pose_min_inlier_ratio", "0.1",
                        "--Mapper.abs_pose_max_num_trials", str(args.max_samples)])


def run_poselib(args, views):
    camera = {"model": "PINHOLE", "width": WIDTH, "height": HEIGHT, "params": PARAMS}
    options = {"max_iterations": args.max_samples, "success_prob": 0.99999, "max_reproj_error": args.max_error,
               "max_error": args.max_error}
    poses, times = [], []
    for X, x, _, _ in views:
        begin = time.process_time()
        pose, _ = poselib.estimate_absolute_pose(x, X, camera, options, {})
        times.append(1e6 * (time.process_time() - begin))
        pose = getattr(pose, "pose", pose)
        poses.append((np.array(pose.R), np.array(pose.t)))
    return poses, times


def run_colmap(args, views):
    camera = pycolmap.Camera(model="PINHOLE", width=WIDTH, height=HEIGHT, params=PARAMS)
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error = args.max_error
    options.ransac.min_inlier_ratio = 0.1
    options.ransac.max_num_trials = args.max_samples
    poses, times = [], []
    for X, x, _, _ in views:
        begin = time.process_time()
        result = pycolmap.estimate_and_refine_absolute_pose(x, X, camera, options)
        times.append(1e6 * (time.process_time() - begin))
        if result is None:
            poses.append(None)
            continue
        pose = result["cam_from_world"]
        poses.append((pose.rotation.matrix(), pose.translation))
    return poses, times


def errors(pose, R, t):
    """Degrees, units."""
    if pose is None:
        return 180.0, 100.0
    cosine = np.clip((np.trace(pose[0].T @ R) - 1) / 2, -1, 1)
    return np.degrees(np.arccos(cosine)), np.linalg.norm(pose[0].T @ pose[1] - R.T @ t)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--holba", default="build/bin/holba")
    parser.add_argument("--views", type=int, default=100, help="of each number of points and share of wrong ones")
    parser.add_argument("--points", default="1000,100,50,20,10")
    parser.add_argument("--wrong", default="0,0.4,0.8")
    parser.add_argument("--noise_px", type=float, default=1.0)
    parser.add_argument("--max_error", type=float, default=12.0)
    parser.add_argument("--max_samples", type=int, default=10000)
    parser.add_argument("--success_deg", type=float, default=2.0)
    parser.add_argument("--success_units", type=float, default=0.1)
    args = parser.parse_args()

    programs = {"holba": run_holba}
    if poselib is not None:
        programs["PoseLib"] = run_poselib
    if pycolmap is not None:
        programs["COLMAP"] = run_colmap
    print("| points | wrong | " + " | ".join(f"{p}: success, centre, ms" for p in programs) + " |")
    print("| ---: | ---: |" + " --- |" * len(programs))
    rng = np.random.default_rng(1)
    for num_points in map(int, args.points.split(",")):
        for wrong in map(float, args.wrong.split(",")):
            views = [make_view(rng, num_points, args.noise_px, wrong) for _ in range(args.views)]
            cells = []
            for function in programs.values():
                poses, times = function(args, views)
                all_errors = np.array([errors(pose, R, t) for pose, (_, _, R, t) in zip(poses, views)])
                right = (all_errors[:, 0] < args.success_deg) & (all_errors[:, 1] < args.success_units)
                cells.append(f"{100 * np.mean(right):.0f} %, {np.median(all_errors[:, 1]):.4f}, "
                             f"{np.mean(times) / 1000:.2f}")
            print(f"| {num_points} | {100 * wrong:.0f} % | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
