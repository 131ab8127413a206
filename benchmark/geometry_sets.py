#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Measures points and lines of `holba refine` against the mesh of a scene, with the cameras held at their true poses,
without and with groups and wireframe; prints Markdown tables. Needs numpy.

DATA/SET/images are the photographs, DATA/SET/gt/ a model with the true poses and PINHOLE cameras, DATA/SET/mesh.ply the
surfaces in metres in the frame of these poses, DATA/SET/colmap/pinhole_fixed COLMAP's model. Only its tracks are used:
they are placed anew on the true cameras (nearest point of their rays, then `holba adjust` with poses held).

The figures are those of `holba evaluate_geometry` (docs/evaluate.md), of lines in 4 or more images: recall is the length
within the distance in metres, precision its share of all length (as in Table 2 of the paper), "touching" the share of
lines with any sample within (what LIMAP calls precision).
Example: benchmark/geometry_sets.py --data DATA --sets greyroom_pinhole --output RUNS
"""

import pathlib
import subprocess
import sys
import tempfile

import numpy as np

from real_sets import KNOWN_INTRINSICS, markdown, parser_of_sets, run
from refine_sets import read_records

SETS = ["greyroom_pinhole", "greyroom_plain"]
THRESHOLDS_MM = [1, 5, 10]
MIN_LINE_IMAGES = 4

# Groups also propose lines and enter their first fit: without them altogether these must be off, too. Features outside
# of a configuration's terms are there in all of them, estimated from their observations.
CONFIGS = [
    ("points, lines, each by itself", ["--Bundle.config", "point_line", "--Lines.propose_from_groups", "0",
                                       "--Lines.vp_weight_px_per_rad", "0", "--Lines.plane_weight", "0"]),
    ("the same, groups propose lines", ["--Bundle.config", "point_line"]),
    ("groups", ["--Bundle.config", "groups"]),
    ("groups and wireframe", ["--Bundle.config", "holistic"]),
]


def rotation(q: list[float]) -> np.ndarray:
    """From a unit quaternion w x y z."""
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def read_images(path: pathlib.Path) -> list[tuple[list[str], list[str]]]:
    """The two lines of each image: its pose, camera and name; its 2D points (of which there may be none)."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    while lines and not lines[-1]:
        lines.pop()
    lines += [""] * (len(lines) % 2)
    return [(lines[i].split(), lines[i + 1].split()) for i in range(0, len(lines), 2)]


def place_tracks(tracks: pathlib.Path, truth: pathlib.Path, output: pathlib.Path) -> tuple[int, int]:
    """Writes the text model `tracks` with the cameras and poses of `truth`, images paired by name, and each point where
    the sum of squared distances to its rays is least. Points that two rays do not fix, or that are behind one of their
    cameras, are left out. Returns how many points there are, and how many were left out."""
    cameras = {fields[0]: fields for fields in read_records(truth / "cameras.txt")}
    poses = {fields[9]: fields for fields, _ in read_images(truth / "images.txt")}
    images = [(fields, points) for fields, points in read_images(tracks / "images.txt") if fields[9] in poses]
    ids, centres, directions, axes = [], [], [], []
    for fields, points in images:
        pose = poses[fields[9]]
        camera = cameras[pose[8]]
        if camera[1] != "PINHOLE":
            sys.exit(f"{truth / 'cameras.txt'}: camera {camera[0]} is {camera[1]}, expected PINHOLE")
        fx, fy, cx, cy = map(float, camera[4:8])
        world_from_cam = rotation([float(x) for x in pose[1:5]]).T
        xy = np.array(points, float).reshape(-1, 3)
        seen = xy[:, 2] >= 0
        rays = np.stack([(xy[seen, 0] - cx) / fx, (xy[seen, 1] - cy) / fy, np.ones(seen.sum())], 1) @ world_from_cam.T
        ids.append(xy[seen, 2].astype(np.int64))
        directions.append(rays / np.linalg.norm(rays, axis=1, keepdims=True))
        centres.append(np.broadcast_to(-world_from_cam @ np.array([float(x) for x in pose[5:8]]), rays.shape))
        axes.append(np.broadcast_to(world_from_cam[:, 2], rays.shape))
    point_ids, point = np.unique(np.concatenate(ids), return_inverse=True)
    centre, direction, axis = map(np.concatenate, (centres, directions, axes))
    across = np.eye(3) - direction[:, :, None] * direction[:, None]
    system, right = np.zeros((len(point_ids), 3, 3)), np.zeros((len(point_ids), 3))
    np.add.at(system, point, across)
    np.add.at(right, point, np.einsum("nij,nj->ni", across, centre))
    # The least eigenvalue is about the squared angle between the rays: 0.1 degrees.
    good = np.linalg.eigvalsh(system)[:, 0] > np.radians(0.1) ** 2
    position = np.linalg.solve(np.where(good[:, None, None], system, np.eye(3)), right[..., None])[..., 0]
    behind = np.einsum("ni,ni->n", position[point] - centre, axis) <= 0
    np.logical_and.at(good, point, ~behind)
    kept = {str(i): xyz for i, xyz, ok in zip(point_ids, position, good) if ok}

    output.mkdir(parents=True, exist_ok=True)
    (output / "cameras.txt").write_text((truth / "cameras.txt").read_text())
    with (output / "images.txt").open("w") as out:
        for fields, points in images:
            words = [word if i % 3 != 2 or word in kept else "-1" for i, word in enumerate(points)]
            print(fields[0], *poses[fields[9]][1:], file=out)
            print(*words, file=out)
    in_model = {fields[0] for fields, _ in images}
    with (output / "points3D.txt").open("w") as out:
        for fields in read_records(tracks / "points3D.txt"):
            if fields[0] in kept:
                track = [x for i in range(8, len(fields), 2) if fields[i] in in_model for x in fields[i:i + 2]]
                print(fields[0], *(f"{x:.17g}" for x in kept[fields[0]]), *fields[4:8], *track, file=out)
    return len(kept), len(point_ids) - len(kept)


def check_poses(model: pathlib.Path, truth: pathlib.Path) -> None:
    """The mesh is in the frame of the true poses: a model in any other must not be measured."""
    poses = {fields[9]: fields for fields, _ in read_images(truth / "images.txt")}
    for fields, _ in read_images(model / "images.txt"):
        true = poses[fields[9]]
        turn = rotation([float(x) for x in fields[1:5]]) - rotation([float(x) for x in true[1:5]])
        shift = [float(a) - float(b) for a, b in zip(fields[5:8], true[5:8])]
        if max(np.abs(turn).max(), np.abs(shift).max()) > 1e-9:
            sys.exit(f"{model}: image {fields[9]} is not at its true pose")


def slashed(values: dict) -> str:
    return " / ".join(f"{values[f'{t}']:.1f}" for t in THRESHOLDS_MM)


def point_cells(points: dict) -> list[str]:
    """Number, shares within the thresholds and median."""
    return [str(points["count"]), slashed(points["inlier_percent"]), f"{points['median_mm']:.2f}"]


def line_cells(lines: dict, limap: dict) -> list[str]:
    """Number, recall in metres, precision, share of lines that touch."""
    return [str(lines["count"]), slashed(lines["recall_m"]), slashed(lines["precision_percent"]),
            slashed(limap["precision_percent"])]


def main() -> None:
    arguments = parser_of_sets(__doc__, SETS).parse_args()

    rows, origin_rows = [], []
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.output or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for name in arguments.sets.split(","):
            data = arguments.data / name
            tracks, placed, start = (folder / f"{name}_{part}" for part in ("tracks", "placed", "start"))
            # convert has no result to print as JSON.
            subprocess.run([arguments.holba, "convert", "--input_path", data / "colmap" / "pinhole_fixed",
                            "--output_path", tracks, "--output_type", "txt", "--quiet"], check=True)
            num_kept, num_left_out = place_tracks(tracks, data / "gt", placed)
            print(f"{name}: {num_kept} points placed, {num_left_out} left out", file=sys.stderr)
            run(arguments.holba, "adjust", "--input_path", placed, "--output_path", start, "--Bundle.config", "point",
                "--Bundle.fix_poses", "1", *KNOWN_INTRINSICS)
            for i, (title, options) in enumerate(CONFIGS):
                model = folder / f"{name}_{i}"
                run(arguments.holba, "refine", "--image_path", data / "images", "--input_path", start, "--output_path",
                    model, "--database_path", folder / f"{name}.db", "--output_type", "txt", "--num_pictures", "0",
                    "--Refine.fix_poses", "1", *options, *arguments.options)
                check_poses(model, data / "gt")
                found = run(arguments.holba, "evaluate_geometry", "--input_path", model, "--mesh_path", data / "mesh.ply",
                            "--thresholds_mm", ",".join(map(str, THRESHOLDS_MM)), "--Geometry.min_line_images",
                            MIN_LINE_IMAGES, "--Geometry.limap_min_line_images", MIN_LINE_IMAGES)
                rows.append([name, title, *point_cells(found["points"]), *line_cells(found["lines"], found["lines_limap"])])
                origin_rows += [[name, title, origin, *point_cells(points)]
                                for origin, points in found["points_by_origin"].items()]
                print(" | ".join(rows[-1]), file=sys.stderr)
    at = " / ".join(map(str, THRESHOLDS_MM))
    print(markdown(["set", "constraints", "points", f"within {at} mm, %", "median, mm", "lines",
                    f"recall @{at} mm, m", "precision, %", "lines touching, %"], rows))
    print("\nPoints by where they come from:\n")
    print(markdown(["set", "constraints", "origin", "points", f"within {at} mm, %", "median, mm"], origin_rows, 3))


if __name__ == "__main__":
    main()
