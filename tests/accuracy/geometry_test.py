#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`holba evaluate_geometry` against an independent computation (geometry_reference.py).

    geometry_test.py HOLBA mesh|cloud|scans|truth
    geometry_test.py HOLBA depth SET      SET/depth, SET/gt and SET/mesh.ply; exit status 77: they are not there"""

import csv
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import zlib

import numpy as np

from geometry_reference import line_figures, multi_view, nearest, point_figures

HOLBA = ""
THRESHOLDS_MM = [1, 5, 10, 200]
NUM_SAMPLES = 50
TOLERANCE = 1e-6


# ---------------------------------------------------------------------------------------------------- files
def write_model(folder: pathlib.Path, points: np.ndarray, lines: np.ndarray, groups: str = "") -> None:
    """Points (n, 3) with ids from 1 and lines (m, 2, 3) with ids from 1 that nothing sees."""
    folder.mkdir()
    (folder / "cameras.txt").write_text("1 PINHOLE 640 480 500 500 320 240\n")
    (folder / "images.txt").write_text("1 1 0 0 0 0 0 0 1 a.jpg\n\n")
    with (folder / "points3D.txt").open("w") as out:
        for i, x in enumerate(points):
            print(i + 1, *(f"{c:.17g}" for c in x), "0 0 0 -1", file=out)
    with (folder / "lines3D.txt").open("w") as out:
        for i, (a, b) in enumerate(lines):
            d = (b - a) / np.linalg.norm(b - a)
            print(i + 1, *(f"{c:.17g}" for c in (*d, *np.cross(a, d), *a, *b)), "0 0 0 -1", file=out)
    if groups:
        (folder / "groups3D.txt").write_text(groups)


def write_mesh(path: pathlib.Path, vertices: np.ndarray, faces: np.ndarray, form: str) -> None:
    """With properties and elements that nobody asked for between those that count."""
    header = ["ply", f"format {form} 1.0", "comment not ours", f"element vertex {len(vertices)}", "property uchar red",
              "property double x", "property double y", "property double z", "element material 2", "property float shine",
              f"element face {len(faces)}", "property short kind", "property list uchar uint vertex_index", "end_header"]
    with path.open("wb") as out:
        out.write(("\n".join(header) + "\n").encode())
        if form == "ascii":
            out.write("".join(f"7 {x:.17g} {y:.17g} {z:.17g}\n" for x, y, z in vertices).encode())
            out.write(b"0.5\n0.25\n")
            out.write("".join(f"-3 3 {a} {b} {c}\n" for a, b, c in faces).encode())
        else:
            order = "<" if "little" in form else ">"
            for x in vertices:
                out.write(struct.pack(order + "B3d", 7, *x))
            out.write(struct.pack(order + "2f", 0.5, 0.25))
            for face in faces:
                out.write(struct.pack(order + "hB3I", -3, 3, *face))


def write_cloud(path: pathlib.Path, points: np.ndarray) -> None:
    with path.open("wb") as out:
        out.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\nproperty double x\n"
                  "property double y\nproperty double z\nend_header\n".encode())
        out.write(points.astype("<f8").tobytes())


def read_depth(path: pathlib.Path) -> np.ndarray:
    """A 16 bit grey PNG, (height, width)."""
    data, at, parts = path.read_bytes(), 8, []
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height, bits, colour = struct.unpack(">IIBB", body[:10])
            assert (bits, colour) == (16, 0), path
        elif kind == b"IDAT":
            parts.append(body)
        at += 12 + size
    raw = np.frombuffer(zlib.decompress(b"".join(parts)), np.uint8).reshape(height, 1 + 2 * width)
    rows = np.zeros((height, 2 * width), np.uint8)
    above = np.zeros(2 * width, np.uint8)
    for i in range(height):
        kind, row = raw[i, 0], raw[i, 1:].copy()
        if kind == 2:
            row += above
        elif kind in (1, 3, 4):
            for x in range(2 * width):
                left, up, corner = (int(row[x - 2]), int(above[x]), int(above[x - 2])) if x >= 2 else (0, int(above[x]), 0)
                if kind == 1:
                    guess = left
                elif kind == 3:
                    guess = (left + up) // 2
                else:
                    p = left + up - corner
                    guess = min((abs(p - left), 0, left), (abs(p - up), 1, up), (abs(p - corner), 2, corner))[2]
                row[x] = (int(row[x]) + guess) & 255
        rows[i] = above = row
    return rows.view(">u2").astype(float)


# ---------------------------------------------------------------------------------------------------- running
def evaluate(*words) -> dict:
    result = subprocess.run([HOLBA, "evaluate_geometry", *map(str, words), "--json", "--thresholds_mm",
                             ",".join(map(str, THRESHOLDS_MM)), "--Geometry.num_samples", str(NUM_SAMPLES),
                             "--Geometry.limap_min_line_images", "0"], capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(result.stderr[-2000:])
    return json.loads(result.stdout)


def check(name: str, found, expected) -> None:
    """Equal numbers in equal places, to TOLERANCE."""
    if isinstance(expected, dict):
        for key, value in expected.items():
            check(f"{name}.{key}", found[key], value)
        return
    if not abs(found - expected) <= TOLERANCE * max(1.0, abs(expected)):
        sys.exit(f"{name}: found {found!r}, expected {expected!r}")


def column(path: pathlib.Path, name: str) -> np.ndarray:
    with path.open() as file:
        return np.array([float(row[name]) for row in csv.DictReader(file)])


def compare(folder: pathlib.Path, points: np.ndarray, lines: np.ndarray, things: np.ndarray, *words) -> None:
    found = evaluate("--input_path", folder / "model", "--output_path", folder / "errors", *words)
    distance = nearest(points, things)
    check("distance_mm", np.abs(column(folder / "errors" / "points.csv", "distance_mm") - 1000 * distance).max(), 0.0)
    check("points", found["points"], point_figures(distance, THRESHOLDS_MM))
    check_colours(folder / "errors" / "errors.ply", 1000 * distance, len(lines))
    paper, limap = line_figures(lines, things, NUM_SAMPLES, THRESHOLDS_MM)
    check("lines", found["lines"], paper)
    check("lines_limap", found["lines_limap"], limap)
    assert 0 < paper["precision_percent"]["200"] < 100, paper  # else nothing was tested


def check_colours(path: pathlib.Path, distance_mm: np.ndarray, num_lines: int) -> None:
    """errors.ply: points first, green to red, violet beyond the largest threshold; then lines in 20 pieces."""
    raw = path.read_bytes()
    begin = raw.index(b"end_header\n") + 11
    counts = {line.split()[1]: int(line.split()[2]) for line in raw[:begin].decode().splitlines() if line.startswith("element")}
    assert counts == {"vertex": len(distance_mm) + 40 * num_lines, "edge": 20 * num_lines}, counts
    vertices = np.frombuffer(raw, np.dtype([("xyz", "<f8", 3), ("rgb", "u1", 3)]), counts["vertex"], begin)
    rgb = vertices["rgb"][:len(distance_mm)].astype(int)
    far = distance_mm > max(THRESHOLDS_MM)
    assert far.any() and not far.all() and (rgb[far] == [160, 0, 200]).all()
    part = distance_mm[~far] / max(THRESHOLDS_MM)
    expected = np.stack([np.minimum(1, 2 * part), np.minimum(1, 2 - 2 * part), 0 * part], axis=1)
    assert np.abs(rgb[~far] - 220 * expected).max() <= 0.5 + 1e-6


# ---------------------------------------------------------------------------------------------------- tests
def random_mesh(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of all sizes, some of them segments, points, or nearly so."""
    size = 10.0 ** rng.uniform(-3, 0, (400, 1, 1))
    corners = rng.normal(0, 1.5, (400, 1, 3)) + size * rng.normal(0, 1, (400, 3, 3))
    corners[::10, 2] = 0.25 * corners[::10, 0] + 0.75 * corners[::10, 1]
    corners[5::20, 1] = corners[5::20, 2]
    corners[7::40, 1] = corners[7::40, 2] = corners[7::40, 0]
    corners[3::40, 2] = 0.5 * (corners[3::40, 0] + corners[3::40, 1]) + 1e-9 * rng.normal(0, 1, (10, 3))
    return corners.reshape(-1, 3), np.arange(1200).reshape(-1, 3)


def test_mesh(folder: pathlib.Path) -> None:
    rng = np.random.default_rng(1)
    vertices, faces = random_mesh(rng)
    near = vertices[faces].mean(axis=1)[rng.integers(0, len(faces), 300)]
    points = np.concatenate([rng.normal(0, 2, (200, 3)), near + 10.0 ** rng.uniform(-4, -1, (300, 1)) * rng.normal(0, 1, (300, 3)),
                             vertices[:30]])
    lines = np.stack([rng.normal(0, 1.5, (60, 3)), rng.normal(0, 1.5, (60, 3))], axis=1)
    write_model(folder / "model", points, lines)
    for form in ("ascii", "binary_little_endian", "binary_big_endian"):
        write_mesh(folder / f"{form}.ply", vertices, faces, form)
        compare(folder, points, lines, vertices[faces], "--mesh_path", folder / f"{form}.ply")


def test_cloud(folder: pathlib.Path) -> None:
    rng = np.random.default_rng(2)
    cloud = rng.normal(0, 0.5, (3000, 3))
    points = np.concatenate([cloud[:300] + rng.normal(0, 0.01, (300, 3)), rng.normal(0, 1, (200, 3))])
    lines = np.stack([rng.normal(0, 0.5, (50, 3)), rng.normal(0, 0.5, (50, 3))], axis=1)
    write_model(folder / "model", points, lines)
    write_cloud(folder / "cloud.ply", cloud)
    compare(folder, points, lines, cloud, "--point_cloud_path", folder / "cloud.ply")


def rotation(rng: np.random.Generator) -> np.ndarray:
    q, _ = np.linalg.qr(rng.normal(0, 1, (3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_scans(folder: pathlib.Path) -> None:
    """Two scans of a wall, reconstructed points on it, in front of it, behind it and beside it."""
    rng = np.random.default_rng(3)
    wall = np.stack([rng.uniform(-1, 1, 4000), rng.uniform(-1, 1, 4000), np.full(4000, 3.0)], axis=1)
    wall += rng.normal(0, 0.002, wall.shape)
    scans, names = [], []
    for i, position in enumerate([np.array([0.2, 0.1, 0.0]), np.array([-0.5, 0.3, 0.4])]):
        R = rotation(rng)
        cloud = (wall[i::2] - position) @ R
        matrix = "\n".join(" ".join(f"{x:.17g}" for x in (*row, shift)) for row, shift in zip(R, position))
        write_cloud(folder / f"scan{i}.ply", cloud)
        names.append(f'<MLMesh label="scan{i}" filename="scan{i}.ply">\n<MLMatrix44>\n{matrix}\n0 0 0 1\n</MLMatrix44>\n</MLMesh>')
        scans.append((cloud, R, position))
    (folder / "scans.mlp").write_text("<!DOCTYPE MeshLabDocument>\n<MeshLabProject>\n<MeshGroup>\n" + "\n".join(names) +
                                      "\n</MeshGroup>\n</MeshLabProject>\n")
    some = wall[rng.integers(0, len(wall), 400)]
    along = np.concatenate([rng.uniform(0.2, 1.3, 200), np.ones(200)])
    points = scans[0][2] + along[:, None] * (some - scans[0][2]) + 10.0 ** rng.uniform(-5, -2, (400, 1)) * rng.normal(0, 1, (400, 3))
    points = np.concatenate([points, rng.uniform(-4, 4, (100, 3))])
    write_model(folder / "model", points, np.zeros((0, 2, 3)))
    found = evaluate("--input_path", folder / "model", "--point_cloud_path", folder / "scans.mlp")["multi_view"]
    expected = multi_view(points, scans, [1, 2, 5, 10])
    check("multi_view", found, expected)
    assert found["free_space"] is True
    # All three kinds of points are there.
    assert 100 < expected["observed"]["1"] < 490 and 10 < expected["accuracy_percent"]["1"] < 90, expected


def test_truth(folder: pathlib.Path) -> None:
    """Primitives and lines that are off by known amounts."""
    rng = np.random.default_rng(4)

    def on_sphere(centre, radius, n):
        d = rng.normal(0, 1, (n, 3))
        return centre + radius * d / np.linalg.norm(d, axis=1)[:, None]

    def on_cylinder(radius, n):
        a, h = rng.uniform(0, 2 * np.pi, n), rng.uniform(-1, 1, n)
        return np.stack([radius * np.cos(a), radius * np.sin(a), h], axis=1) + [5, 0, 0]

    def on_plane(height, n):
        return np.stack([rng.uniform(-2, 2, n), rng.uniform(-2, 2, n), np.full(n, height)], axis=1)

    def group(i, kind, params, first, n):
        return f"{i} {kind} {len(params)} {' '.join(f'{p:.17g}' for p in params)} {n} {' '.join(str(first + k) for k in range(n))} 0 0\n"

    def model(name, radius, shift, tilt, height, cylinder):
        spheres = [on_sphere(np.array([0, 0, 1.0]) + shift, radius, 50), on_sphere(np.array([0, 3.0, 1]), 0.5, 50)]
        points = np.concatenate([*spheres, on_plane(height, 50), on_cylinder(cylinder, 50)])
        axis = np.array([np.sin(tilt), 0, np.cos(tilt)])
        moment = np.cross([5, 0.003, 0], axis)
        groups = (group(10, "SPHERE", [*np.array([0, 0, 1.0]) + shift, radius], 1, 50) +
                  group(20, "SPHERE", [0, 3, 1, 0.5], 51, 50) +
                  group(30, "PLANE", [0, 0, 1, -height], 101, 50) +
                  group(40, "CYLINDER", [*axis, *moment, cylinder], 151, 50))
        write_model(folder / name, points, lines[name], groups)

    edges = np.array([[[0, 0, 0], [2.0, 0, 0]], [[0, 0, 0], [0, 1.0, 0]], [[0, 0, 0], [0, 0, 1.0]]])
    # The first: its first half 4 mm off; the second: crossing at a right angle; the third is not found.
    lines = {"truth": edges, "model": np.array([[[0, 0.004, 0], [1.0, 0.004, 0]], [[-0.5, 0.25, 0], [0.5, 0.25, 0]]])}
    model("truth", 1.0, np.zeros(3), 0.0, -2.0, 0.3)
    model("model", 1.02, np.array([0.006, 0, 0.008]), 0.01, -2.004, 0.297)
    found = evaluate("--input_path", folder / "model", "--ground_truth_path", folder / "truth")
    primitives = found["primitives"]
    check("spheres", primitives["SPHERE"], {"true": 2, "found": 2, "extra": 0, "radius_mm": {"max": 20.0, "median": 10.0},
                                           "radius_percent": {"max": 2.0}, "centre_mm": {"max": 10.0}})
    check("planes", primitives["PLANE"], {"found": 1, "offset_mm": {"max": 4.0}, "normal_deg": {"max": 0.0}})
    check("cylinders", primitives["CYLINDER"], {"found": 1, "radius_mm": {"max": 3.0}, "radius_percent": {"max": 1.0},
                                               "axis_deg": {"max": np.degrees(0.01)}})
    check("edges", found["edges"], {
        "count": 3, "length_m": 4.0, "lines": 2, "recall_m": {"1": 0.0, "5": 1.0, "10": 1.0, "200": 1.2},
        "recall_percent": {"1": 0.0, "5": 25.0, "200": 30.0}, "precision_percent": {"1": 0.0, "5": 50.0, "200": 50.0},
        "angle_deg": {"max": 0.0}, "offset_mm": {"median": 4.0}})
    # The same edges as a file.
    (folder / "edges.ply").write_text("ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
                                      "property float z\nelement edge 3\nproperty int vertex1\nproperty int vertex2\n"
                                      "end_header\n" + "".join(f"{x} {y} {z}\n" for x, y, z in edges.reshape(-1, 3)) +
                                      "0 1\n2 3\n4 5\n")
    of_file = evaluate("--input_path", folder / "model", "--ground_truth_path", folder / "edges.ply")
    check("edges of a file", of_file["edges"], found["edges"])


def test_depth(folder: pathlib.Path, data: pathlib.Path) -> None:
    """Points of the depth maps at true poses are as far from the mesh as numpy says, and as the rounding of the depth
    to whole millimetres lets them be."""
    if not all((data / part).exists() for part in ("depth", "gt", "mesh.ply")):
        print(f"SKIPPED, NOT TESTED: no depth, gt and mesh.ply in {data}", file=sys.stderr)
        sys.exit(77)
    fields = [line.split() for line in (data / "gt" / "cameras.txt").read_text().splitlines() if not line.startswith("#")][0]
    fx, fy, cx, cy = map(float, fields[4:8])
    points = []
    poses = [line.split() for line in (data / "gt" / "images.txt").read_text().splitlines()
             if line and not line.startswith("#")]
    for pose in poses[::5]:
        w, x, y, z = map(float, pose[1:5])
        R = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                      [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                      [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
        depth = read_depth(data / "depth" / pathlib.Path(pose[9]).with_suffix(".png")) / 1000
        v, u = np.meshgrid(np.arange(20, depth.shape[0], 40), np.arange(20, depth.shape[1], 40), indexing="ij")
        d = depth[v, u]
        rays = np.stack([(u + 0.5 - cx) / fx * d, (v + 0.5 - cy) / fy * d, d], axis=-1)[d > 0]
        points.append((rays - np.array(list(map(float, pose[5:8])))) @ R)
    points = np.concatenate(points)
    raw = (data / "mesh.ply").read_bytes()
    begin = raw.index(b"end_header\n") + 11
    counts = [int(line.split()[2]) for line in raw[:begin].decode().splitlines() if line.startswith("element")]
    vertices = np.frombuffer(raw, "<f4", 3 * counts[0], begin).reshape(-1, 3).astype(float)
    faces = np.frombuffer(raw, np.dtype([("n", "u1"), ("corners", "<i4", 3)]), counts[1], begin + 12 * counts[0])["corners"]
    write_model(folder / "model", points, np.zeros((0, 2, 3)))
    evaluate("--input_path", folder / "model", "--mesh_path", data / "mesh.ply", "--output_path", folder / "errors")
    found_mm = column(folder / "errors" / "points.csv", "distance_mm")
    # A triangle can only be the nearest of a point if its box reaches as near as what was found.
    triangles = vertices[faces]
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    for x, mm in zip(points[::3], found_mm[::3]):
        off = np.linalg.norm(np.maximum(np.maximum(low - x, x - high), 0), axis=1)
        candidates = triangles[off <= mm / 1000 + 1e-3]
        check("distance_mm", mm, 1000 * nearest(x[None], candidates)[0])
    median, far = np.median(found_mm), np.mean(found_mm > 1.0)
    print(f"{len(points)} points of depth maps: median {median:.3f} mm from the mesh, {100 * far:.2f} % beyond 1 mm")
    if not (median < 0.5 and far < 0.02):
        sys.exit("the depth maps are not on the mesh")


def main() -> int:
    global HOLBA
    HOLBA, name = sys.argv[1:3]
    with tempfile.TemporaryDirectory() as folder:
        globals()[f"test_{name}"](pathlib.Path(folder), *map(pathlib.Path, sys.argv[3:]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
