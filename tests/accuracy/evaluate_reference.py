#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""An independent `holba evaluate`: number of residuals and sum of squares of every term, from the text files of a
model. Written from docs/FORMAT.md alone, with numpy, one array operation per term and image, in no way after the
C++ code.

    evaluate_reference.py MODEL_DIR            prints the JSON object
    evaluate_reference.py MODEL_DIR --holba P  compares with `P evaluate --json` to 1e-9, exit status 1 on difference
"""

import argparse
import collections
import json
import pathlib
import subprocess
import sys

import numpy as np

TERMS = ("point", "line", "group_point", "group_line", "vp", "wireframe_point", "wireframe_line", "relation")
NO_ID = -1


# --------------------------------------------------------------------------------------------- cameras
class Camera:
    """pi and the inverse of its distortion. Normalised coordinates are (x/z, y/z)."""

    LAYOUT = {  # model: number of focal lengths, number of distortion parameters
        "SIMPLE_PINHOLE": (1, 0), "PINHOLE": (2, 0), "SIMPLE_RADIAL": (1, 1), "RADIAL": (1, 2), "OPENCV": (2, 4),
        "FULL_OPENCV": (2, 8), "OPENCV_FISHEYE": (2, 4), "SIMPLE_RADIAL_FISHEYE": (1, 1), "RADIAL_FISHEYE": (1, 2),
    }

    def __init__(self, name: str, params: list[float]):
        if name not in self.LAYOUT:
            raise SystemExit(f"camera model {name} is unknown to evaluate_reference.py")
        num_focal, num_extra = self.LAYOUT[name]
        assert len(params) == num_focal + 2 + num_extra, (name, params)
        self.focal = np.array([params[0], params[num_focal - 1]])
        self.centre = np.array(params[num_focal:num_focal + 2])
        self.extra = params[num_focal + 2:]
        self.name = name

    def distort(self, uv: np.ndarray) -> np.ndarray:
        """Distorted normalised coordinates, (n, 2) -> (n, 2)."""
        u, v = uv[:, 0], uv[:, 1]
        e = self.extra
        r2 = u * u + v * v
        if "FISHEYE" in self.name:
            r = np.sqrt(r2)
            theta = np.arctan(r)
            k = list(e) + [0.0] * (4 - len(e))
            bent = theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8)
            return uv * np.where(r > 1e-12, bent / np.maximum(r, 1e-12), 1.0)[:, None]
        if self.name in ("SIMPLE_RADIAL", "RADIAL"):
            k2 = e[1] if len(e) > 1 else 0.0
            return uv * (1 + e[0] * r2 + k2 * r2**2)[:, None]
        if self.name in ("OPENCV", "FULL_OPENCV"):
            k1, k2, p1, p2 = e[:4]
            radial = 1 + k1 * r2 + k2 * r2**2
            if self.name == "FULL_OPENCV":
                radial = (radial + e[4] * r2**3) / (1 + e[5] * r2 + e[6] * r2**2 + e[7] * r2**3)
            return np.stack([u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u),
                             v * radial + 2 * p2 * u * v + p1 * (r2 + 2 * v * v)], axis=1)
        return uv

    def undistort(self, target: np.ndarray) -> np.ndarray:
        """Inverse of distort by Newton's method, derivatives by central differences, steps halved where they do not help."""
        uv = target.copy()
        if not self.extra:
            return uv
        for _ in range(100):
            error = self.distort(uv) - target
            h = 1e-6
            du = (self.distort(uv + [h, 0]) - self.distort(uv - [h, 0])) / (2 * h)
            dv = (self.distort(uv + [0, h]) - self.distort(uv - [0, h])) / (2 * h)
            det = du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]
            step = np.stack([(dv[:, 1] * error[:, 0] - dv[:, 0] * error[:, 1]) / det,
                             (du[:, 0] * error[:, 1] - du[:, 1] * error[:, 0]) / det], axis=1)
            factor = np.ones(len(uv))
            for _ in range(30):
                worse = (np.linalg.norm(self.distort(uv - factor[:, None] * step) - target, axis=1)
                         > np.linalg.norm(error, axis=1) + 1e-15)
                if not worse.any():
                    break
                factor[worse] *= 0.5
            uv = uv - factor[:, None] * step
            if np.abs(step).max(initial=0) < 1e-16:
                break
        return uv

    def project(self, x: np.ndarray) -> np.ndarray:
        """Pixels of points in the camera, (n, 3) -> (n, 2)."""
        return self.distort(x[:, :2] / x[:, 2:]) * self.focal + self.centre

    def project_ideal(self, x: np.ndarray) -> np.ndarray:
        return x[:, :2] / x[:, 2:] * self.focal + self.centre

    def ideal(self, pixels: np.ndarray) -> np.ndarray:
        """Observed pixels as ideal pixels."""
        if not self.extra:
            return pixels
        return self.undistort((pixels - self.centre) / self.focal) * self.focal + self.centre

    def line_matrix(self) -> np.ndarray:
        """K_l, the cofactors of K."""
        K = np.array([[self.focal[0], 0, self.centre[0]], [0, self.focal[1], self.centre[1]], [0, 0, 1]])
        return np.linalg.det(K) * np.linalg.inv(K).T


# --------------------------------------------------------------------------------------------- files
def records(path: pathlib.Path) -> list[list[str]]:
    if not path.exists():
        return []
    lines = (line.strip() for line in path.read_text().split("\n"))
    return [line.split() for line in lines if line and not line.startswith("#")]


def rotation_of(q: list[float]) -> np.ndarray:
    """From a quaternion w x y z."""
    w, x, y, z = np.array(q) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


class Fields:
    """Takes the fields of a record one after the other."""

    def __init__(self, words: list[str]):
        self.words, self.at = words, 0

    def take(self, kind, count: int) -> list:
        values = [kind(word) for word in self.words[self.at:self.at + count]]
        assert len(values) == count, self.words[:8]
        self.at += count
        return values

    def list_of_ints(self) -> list[int]:
        return self.take(int, self.take(int, 1)[0])


class Model:
    def __init__(self, folder: pathlib.Path):
        self.cameras = {int(r[0]): Camera(r[1], [float(x) for x in r[4:]]) for r in records(folder / "cameras.txt")}
        self.images = {}
        self._read_images(folder / "images.txt")
        self.points = {int(r[0]): np.array([float(x) for x in r[1:4]]) for r in records(folder / "points3D.txt")}
        self.point_tracks = {int(r[0]): [(int(a), int(b)) for a, b in zip(r[8::2], r[9::2])]
                             for r in records(folder / "points3D.txt")}
        self.segments = {}  # image id -> (n, 4)
        for r in records(folder / "lines2D.txt"):
            values = np.array([float(x) for x in r[2:]]).reshape(int(r[1]), 5)
            self.segments[int(r[0])] = values[:, :4]
        self.lines, self.line_tracks = {}, {}
        for r in records(folder / "lines3D.txt"):
            d, m = np.array([float(x) for x in r[1:4]]), np.array([float(x) for x in r[4:7]])
            self.lines[int(r[0])] = np.concatenate([d, m]) / np.linalg.norm(d)
            self.line_tracks[int(r[0])] = [(int(a), int(b)) for a, b in zip(r[17::2], r[18::2])]
        self.groups = {}
        for r in records(folder / "groups3D.txt"):
            fields = Fields(r)
            group_id, kind = fields.take(int, 1)[0], fields.take(str, 1)[0]
            params = np.array(fields.take(float, fields.take(int, 1)[0]))
            self.groups[group_id] = (kind, params, fields.list_of_ints(), fields.list_of_ints())
        self.edges = [(int(r[0]), int(r[1])) for r in records(folder / "wireframe.txt")]
        self.relations = [(int(r[0]), int(r[1]), r[2]) for r in records(folder / "relations.txt")]

    def _read_images(self, path: pathlib.Path):
        lines = [line for line in path.read_text().split("\n") if not line.startswith("#")]
        at = 0
        while at < len(lines):
            if not lines[at].strip():
                at += 1
                continue
            r = lines[at].split(None, 9)
            pixels = np.array([float(x) for x in lines[at + 1].split()] if at + 1 < len(lines) else []).reshape(-1, 3)
            self.images[int(r[0])] = (rotation_of([float(x) for x in r[1:5]]), np.array([float(x) for x in r[5:8]]),
                                      int(r[8]), pixels[:, :2])
            at += 2


# --------------------------------------------------------------------------------------------- geometry
def point_in_camera(image, X: np.ndarray) -> np.ndarray:
    return X @ image[0].T + image[1]


def image_of_line(camera: Camera, image, L: np.ndarray) -> np.ndarray:
    """l of lines (n, 6) -> (n, 3)."""
    R, t = image[0], image[1]
    d = L[:, :3] @ R.T
    m = L[:, 3:] @ R.T + np.cross(np.broadcast_to(t, d.shape), d)
    return m @ camera.line_matrix().T


def rho(l: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """(n, 3), (n, 4) -> (n, 4)."""
    parts = []
    for x in (segments[:, :2], segments[:, 2:]):
        s = np.sum(l[:, :2] * x, axis=1) + l[:, 2]
        parts.append((s / np.sum(l[:, :2] ** 2, axis=1))[:, None] * l[:, :2])
    return np.concatenate(parts, axis=1)


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def cuboid_faces(p: np.ndarray) -> list[np.ndarray]:
    R = rotation_of(list(p[:4]))
    return [np.append((1 if i % 2 == 0 else -1) * R[:, i // 2], p[4 + i]) for i in range(6)]


def nearest_face(p: np.ndarray, x: np.ndarray) -> np.ndarray:
    return min(cuboid_faces(p), key=lambda f: abs(f[:3] @ x + f[3]))


def cuboid_centre(p: np.ndarray) -> np.ndarray:
    """Half-way between opposite faces: n.c = (w of the opposite - w of the face) / 2."""
    R = rotation_of(list(p[:4]))
    return sum(0.5 * (p[5 + 2 * k] - p[4 + 2 * k]) * R[:, k] for k in range(3))


def project_on_group(kind: str, p: np.ndarray, X: np.ndarray):
    """Proj_G of a point; None where it is undefined."""
    if kind == "PLANE":
        n = unit(p[:3])
        return X - (n @ X + p[3]) * n
    if kind == "SPHERE":
        u = X - p[:3]
        return None if not u.any() else p[:3] + p[3] * unit(u)
    if kind == "CYLINDER":
        d = unit(p[:3])
        foot = np.cross(d, p[3:6])
        along = foot + d * (d @ (X - foot))
        return None if not (X - along).any() else along + p[6] * unit(X - along)
    if kind == "CONE":
        apex, d, alpha = p[:3], unit(p[3:6]), p[6]
        v = X - apex
        height = v @ d
        across = v - height * d
        if not across.any():
            return apex if height <= 0 else None  # on the axis inside, every generatrix is as near
        generatrix = np.cos(alpha) * d + np.sin(alpha) * unit(across)
        s = v @ generatrix
        return apex + max(s, 0.0) * generatrix
    if kind == "ELLIPSOID":
        R, centre, axes = rotation_of(list(p[:4])), p[4:7], p[7:10]
        u = (R.T @ (X - centre)) / axes
        return None if not u.any() else centre + R @ (axes * unit(u))
    if kind == "CUBOID":
        face = nearest_face(p, X)
        return X - (face[:3] @ X + face[3]) * face[:3]
    raise SystemExit(f"group type {kind} is unknown to evaluate_reference.py")


def project_line_on_group(kind: str, p: np.ndarray, L: np.ndarray):
    d, m = L[:3], L[3:]
    if kind == "PLANE":
        plane = p / np.linalg.norm(p[:3])
    elif kind == "CUBOID":
        foot = np.cross(d, m)
        nearest = foot + d * (d @ (cuboid_centre(p) - foot))
        plane = nearest_face(p, nearest)
    else:
        raise SystemExit(f"{kind} holds lines, unknown to evaluate_reference.py")
    n, w = plane[:3], plane[3]
    # Two points of the line, each projected on the plane (not the closed formula of the format).
    foot = np.cross(d, m)
    a, b = (x - (n @ x + w) * n for x in (foot, foot + d))
    if np.linalg.norm(b - a) < 1e-12:
        return None
    direction = unit(b - a)
    return np.concatenate([direction, np.cross(a, direction)])


# --------------------------------------------------------------------------------------------- terms
class Sums:
    def __init__(self):
        self.residuals = collections.Counter({term: 0 for term in TERMS})
        self.squares = collections.Counter({term: 0.0 for term in TERMS})

    def add(self, term: str, r: np.ndarray):
        self.residuals[term] += len(r)
        self.squares[term] += float(np.sum(r * r))


def by_image(items: list[tuple]) -> dict[int, list[tuple]]:
    """Groups (image_id, ...) by image."""
    found = collections.defaultdict(list)
    for item in items:
        found[item[0]].append(item[1:])
    return found


def evaluate(model: Model) -> dict:
    sums = Sums()
    ideal_segments, ideal_points = {}, {}
    for image_id, image in model.images.items():
        camera = model.cameras[image[2]]
        segments = model.segments.get(image_id, np.zeros((0, 4)))
        ends = camera.ideal(segments.reshape(-1, 2))
        ideal_segments[image_id] = ends.reshape(-1, 4)
        ideal_points[image_id] = camera.ideal(image[3]) if model.edges else image[3]

    def points_in_images(term, items):
        """items: (image id, point, other point or None, observation or None)."""
        for image_id, entries in by_image(items).items():
            image = model.images[image_id]
            camera = model.cameras[image[2]]
            X = point_in_camera(image, np.array([e[0] for e in entries]))
            Y = point_in_camera(image, np.array([e[1] for e in entries])) if entries[0][1] is not None else None
            front = X[:, 2] > 0
            if Y is not None:
                front &= Y[:, 2] > 0
                sums.add(term, camera.project(X[front]) - camera.project(Y[front]))
            else:
                sums.add(term, camera.project(X[front]) - np.array([e[2] for e in entries])[front])

    def lines_in_images(term, items):
        """items: (image id, segment index, line, other line or None)."""
        for image_id, entries in by_image(items).items():
            image = model.images[image_id]
            camera = model.cameras[image[2]]
            segments = ideal_segments[image_id][[e[0] for e in entries]]
            r = rho(image_of_line(camera, image, np.array([e[1] for e in entries])), segments)
            if entries[0][2] is not None:
                r = r - rho(image_of_line(camera, image, np.array([e[2] for e in entries])), segments)
            sums.add(term, r)

    points_in_images("point", [(image_id, model.points[p], None, model.images[image_id][3][idx])
                               for p, track in model.point_tracks.items() for image_id, idx in track])
    lines_in_images("line", [(image_id, idx, model.lines[l], None)
                             for l, track in model.line_tracks.items() for image_id, idx in track])

    group_points, group_lines, sines = [], [], []
    for kind, params, point_ids, line_ids in model.groups.values():
        for p in point_ids:
            on_group = project_on_group(kind, params, model.points[p])
            if on_group is not None:
                group_points += [(image_id, model.points[p], on_group, None) for image_id, _ in model.point_tracks[p]]
        for l in line_ids:
            if kind == "VP":
                sines.append(np.cross(model.lines[l][:3], unit(params)))
                continue
            on_group = project_line_on_group(kind, params, model.lines[l])
            if on_group is not None:
                group_lines += [(image_id, idx, model.lines[l], on_group) for image_id, idx in model.line_tracks[l]]
    points_in_images("group_point", group_points)
    lines_in_images("group_line", group_lines)
    sums.add("vp", np.array(sines).reshape(-1, 3))

    for p, l in model.edges:
        seen_by_point = {image_id for image_id, _ in model.point_tracks[p]}
        seen_by_line = {image_id for image_id, _ in model.line_tracks[l]}
        for image_id, idx in model.line_tracks[l]:
            if image_id in seen_by_point:
                continue
            image = model.images[image_id]
            x = point_in_camera(image, model.points[p][None])
            if x[0, 2] <= 0:
                continue
            x1, y1, x2, y2 = ideal_segments[image_id][idx]
            u, v = model.cameras[image[2]].project_ideal(x)[0]
            sums.add("wireframe_point", np.array([((x2 - x1) * (v - y1) - (y2 - y1) * (u - x1))
                                                  / np.hypot(x2 - x1, y2 - y1)]))
        for image_id, idx in model.point_tracks[p]:
            if image_id in seen_by_line:
                continue
            image = model.images[image_id]
            line = image_of_line(model.cameras[image[2]], image, model.lines[l][None])[0]
            u, v = ideal_points[image_id][idx]
            sums.add("wireframe_line", np.array([(line @ [u, v, 1]) / np.hypot(line[0], line[1])]))

    for a, b, kind in model.relations:
        da, db = (unit(model.groups[g][1][:3]) for g in (a, b))
        sums.add("relation", np.array([[da @ db]]) if kind == "ORTHOGONAL" else np.cross(da, db)[None])

    return {"terms": {term: {"residuals": sums.residuals[term], "sum_squares": sums.squares[term]} for term in TERMS}}


def compare(ours: dict, theirs: dict) -> list[str]:
    """Differences beyond 1e-9 of the sum (and 1e-22 per residual, what rounding leaves of exact zeros)."""
    faults = []
    for term in TERMS:
        a, b = ours["terms"][term], theirs["terms"].get(term)
        if b is None:
            faults.append(f"{term} is missing")
            continue
        tolerance = 1e-9 * max(a["sum_squares"], b["sum_squares"]) + 1e-22 * a["residuals"]
        good = a["residuals"] == b["residuals"] and abs(a["sum_squares"] - b["sum_squares"]) <= tolerance
        relative = abs(a["sum_squares"] - b["sum_squares"]) / max(a["sum_squares"], 1e-300)
        print(f"{term:<16} {a['residuals']:>8} {b['residuals']:>8} {a['sum_squares']:>24.17g} {relative:>9.1e}"
              f"{'' if good else '   DIFFERS'}")
        if not good:
            faults.append(f"{term}: reference {a}, holba {b}")
    return faults


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=pathlib.Path)
    parser.add_argument("--holba", help="path of the holba program to compare with")
    args = parser.parse_args()
    ours = evaluate(Model(args.model))
    if not args.holba:
        print(json.dumps(ours, indent=2))
        return 0
    output = subprocess.run([args.holba, "evaluate", "--input_path", str(args.model), "--json"], check=True,
                            capture_output=True, text=True).stdout
    faults = compare(ours, json.loads(output))
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
