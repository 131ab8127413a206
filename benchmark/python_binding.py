# SPDX-License-Identifier: BSD-3-Clause
"""What Python costs: an adjustment against the program's, points as arrays, residuals written in Python.

python_binding.py --program build/bin/holba [--repeats 3]. Prints a table (docs/python.md has one). Times are CPU
seconds of one thread, the least of the repeats, in turns.
"""

import argparse
import pathlib
import resource
import subprocess
import tempfile
import time

import holba
import numpy as np


def cpu(call):
    begin = time.process_time()
    result = call()
    return time.process_time() - begin, result


def cpu_of_children():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def adjust_times(program: str, folder: pathlib.Path, num_images: int, repeats: int):
    """CPU seconds of reading, adjusting and writing a model: in Python, and of the whole program."""
    holba.synthesize(output_path=folder / "scene", num_images=num_images, seed=1, vps=True)

    def in_python():
        model = holba.read_model(folder / "scene/perturbed")
        holba.adjust(model, num_threads=1)
        model.write(folder / "out")

    python, native = [], []
    for _ in range(repeats):
        before = cpu_of_children()
        subprocess.run(
            [program, "adjust", "--input_path", folder / "scene/perturbed", "--output_path", folder / "out",
             "--Solver.num_threads", "1", "--json", "--quiet"], check=True, capture_output=True)
        native.append(cpu_of_children() - before)
        python.append(cpu(in_python)[0])
    return min(python), min(native)


def million_points():
    """Seconds until a million points of a model are an array, and whether it owns them."""
    model = holba.Reconstruction()
    n = 1_000_000
    model._put_points(np.arange(1, n + 1, dtype=np.uint64), np.random.default_rng(1).normal(size=(n, 3)),
                      np.zeros((n, 3), np.uint8), np.zeros(n), np.zeros(n + 1, np.uint64), np.zeros((0, 2), np.uint32))
    model = model.copy()
    seconds, xyz = cpu(lambda: model.points3D.xyz(copy=False))
    return seconds, xyz.flags.owndata, xyz.shape


def rotate(quats, X):
    q, w = quats[:, :3], quats[:, 3:]
    return X + 2 * np.cross(q, np.cross(q, X) + w * X)


def residual_times(folder: pathlib.Path, repeats: int):
    """CPU seconds of ten iterations on 10 000 observations: native, in Python with and without derivatives."""
    options = {"config": "point", "point_loss": "trivial", "refine_focal_length": False}
    holba.synthesize(output_path=folder / "points", num_images=170, seed=3, feature_noise=0.02)
    model = holba.read_model(folder / "points/truth")
    table = model.point_observations()
    f, cx, cy = next(iter(model.cameras.values())).params

    def values(X, pose, xy):
        Y = rotate(pose[:, :4], X) + pose[:, 4:]
        return f * Y[:, :2] / Y[:, 2:] + [cx, cy] - xy

    def derivatives(X, pose, xy):
        RX = rotate(pose[:, :4], X)
        Y = RX + pose[:, 4:]
        n = len(X)
        d = np.zeros((n, 2, 3))
        d[:, 0, 0] = d[:, 1, 1] = f / Y[:, 2]
        d[:, :, 2] = -f * Y[:, :2] / Y[:, 2:] ** 2
        R = np.stack([rotate(pose[:, :4], np.broadcast_to(e, (n, 3))) for e in np.eye(3)], axis=2)
        cross = np.zeros((n, 3, 3))
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            cross[:, b, c], cross[:, c, b] = RX[:, a], -RX[:, a]
        return [d @ R, np.concatenate([d @ cross, d], axis=2), np.broadcast_to(-np.eye(2), (n, 2, 2))]

    def problem(kind):
        if kind == "native":
            return holba.build_problem(model, **options)
        made = holba.build_problem(model, point_weight=0.0, **options)
        frame = {i: image.frame_id for i, image in model.images.items()}
        rows = [(made.point_blocks[int(p)], made.pose_blocks[frame[int(i)]], made.add_block("pixel", xy, constant=True))
                for p, i, xy in zip(table["point3D_id"], table["image_id"], table["xy"]) if int(p) in made.point_blocks]
        made.add_residuals("mine", 2, values, np.array(rows), jacobian=derivatives if kind == "python" else None)
        return made

    solve = {"num_threads": 1, "max_num_iterations": 10, "function_tolerance": 0.0, "gradient_tolerance": 0.0,
             "parameter_tolerance": 0.0}
    times = {}
    for kind in ("native", "python", "numeric"):
        tries = []
        for _ in range(repeats):
            made = problem(kind)
            seconds, summary = cpu(lambda: holba.solve(made, **solve))
            tries.append(seconds / max(summary.iterations, 1))
        times[kind] = min(tries)
    return len(table["xy"]), times


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--num_images", type=int, default=200, help="of the adjustment")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        seconds, owns, shape = million_points()
        print(f"points {shape} as an array: {seconds * 1e3:.2f} ms, a copy: {owns}")
        n, times = residual_times(folder, arguments.repeats)
        print(f"an iteration on {n} observations: native {times['native'] * 1e3:.2f} ms, in Python "
              f"{times['python'] * 1e3:.2f} ms ({times['python'] / times['native']:.1f} times), with numeric derivatives "
              f"{times['numeric'] * 1e3:.2f} ms ({times['numeric'] / times['native']:.1f} times)")
        python, native = adjust_times(arguments.program, folder, arguments.num_images, arguments.repeats)
        print(f"adjustment of {arguments.num_images} images: program {native:.3f} s, Python {python:.3f} s ({python / native - 1:+.1%})")


main()
