# SPDX-License-Identifier: BSD-3-Clause
"""Photographs of a scene that is known: the corner of a room with painted rectangles on two walls and the floor,
and a pillar before it, seen by a lens with distortion; and a COLMAP model of its points, poses as they were."""

import pathlib
import shutil
import struct
import sys
import zlib

import numpy as np

WIDTH, HEIGHT = 480, 360
FOCAL, RADIAL = 400.0, -0.06   # SIMPLE_RADIAL, principal point in the middle
NUM_IMAGES = 6
SAMPLES = 2                    # in each direction, of a pixel
POINT_NOISE_PX = 0.2

# y points down. A surface: origin, its two directions, lengths along them, grey.
SURFACES = {
    "back": ((-2.0, -1.5, 4.0), (1, 0, 0), (0, 1, 0), 4.5, 2.5, 150),
    "left": ((-2.0, -1.5, 0.0), (0, 0, 1), (0, 1, 0), 4.0, 2.5, 110),
    "floor": ((-2.0, 1.0, 0.0), (1, 0, 0), (0, 0, 1), 4.5, 4.0, 190),
}
# On each: place along both directions, lengths, grey.
RECTANGLES = {
    "back": [(0.35, 0.3, 0.9, 0.8, 40), (1.63, 0.42, 0.8, 0.85, 230), (2.83, 0.25, 1.1, 0.7, 60),
             (0.55, 1.4, 0.7, 0.83, 220), (2.77, 1.35, 0.9, 0.79, 30)],
    "left": [(0.9, 0.35, 1.0, 0.9, 210), (2.45, 0.22, 0.9, 1.03, 30), (2.2, 1.47, 1.2, 0.66, 200)],
    "floor": [(0.6, 1.2, 1.1, 1.0, 60), (0.41, 2.6, 1.0, 0.9, 110), (2.66, 2.33, 1.2, 1.1, 90)],
}
PILLAR = (1.25, 2.6, 0.3)  # x, z, radius
LABELS = {"back": 1, "left": 2, "floor": 3, "pillar": 7}
LABELS_JSON = '{"labels": {"1": "plane", "2": "plane", "3": "plane", "7": "cylinder"}}\n'


def poses() -> list[tuple[np.ndarray, np.ndarray]]:
    """Rotation and translation, world to camera, of each image."""
    found = []
    for i in range(NUM_IMAGES):
        s = i / (NUM_IMAGES - 1) - 0.5
        centre = np.array([0.9 + 2.0 * s, -0.5 + 0.5 * (i % 2), -1.9 + 0.5 * abs(s)])
        z = np.array([-0.2 - 0.5 * s, 0.05, 3.0]) - centre
        z /= np.linalg.norm(z)
        x = np.cross([0, 1, 0], z)
        x /= np.linalg.norm(x)
        rotation = np.stack([x, np.cross(z, x), z])
        found.append((rotation, -rotation @ centre))
    return found


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """w x y z of a rotation by less than half a turn."""
    w = np.sqrt(1 + np.trace(rotation)) / 2
    return np.array([w, *((rotation[k[0], k[1]] - rotation[k[1], k[0]]) / (4 * w)
                          for k in ((2, 1), (0, 2), (1, 0)))])


def edges() -> list[tuple[np.ndarray, np.ndarray]]:
    """Ends of the sides of all rectangles."""
    found = []
    for name, (origin, u, v, _, _, _) in SURFACES.items():
        origin, u, v = (np.array(a, float) for a in (origin, u, v))
        for a, b, w, h, _ in RECTANGLES[name]:
            corners = [origin + (a + da) * u + (b + db) * v for da, db in ((0, 0), (w, 0), (w, h), (0, h))]
            found += [(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    return found


class Texture:
    """Smooth random grey, finer than the rectangles."""

    def __init__(self, seed: int, amplitude: float, cell: float):
        self.grid = np.random.default_rng(seed).uniform(-amplitude, amplitude, (128, 128))
        self.cell = cell

    def __call__(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        a, b = a / self.cell, b / self.cell
        i, j = np.floor(a).astype(int), np.floor(b).astype(int)
        a, b = a - i, b - j
        g = lambda di, dj: self.grid[(i + di) % 128, (j + dj) % 128]
        return (g(0, 0) * (1 - a) + g(1, 0) * a) * (1 - b) + (g(0, 1) * (1 - a) + g(1, 1) * a) * b


def trace(centre: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Grey, label, place along the ray and normal of what the rays (N x 3) hit first; label 0: nothing."""
    depth = np.full(len(rays), np.inf)
    normals = np.zeros((len(rays), 3))
    grey = np.full(len(rays), 128.0)
    label = np.zeros(len(rays), np.uint8)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k, (name, (origin, u, v, width, height, base)) in enumerate(SURFACES.items()):
            origin, u, v = (np.array(x, float) for x in (origin, u, v))
            normal = np.cross(u, v)
            t = normal @ (origin - centre) / (rays @ normal)
            at = centre + t[:, None] * rays - origin
            a, b = at @ u, at @ v
            hit = (t > 0) & (t < depth) & (a >= 0) & (a < width) & (b >= 0) & (b < height)
            a, b = a[hit], b[hit]
            value = np.full(len(a), float(base))
            for ra, rb, rw, rh, painted in RECTANGLES[name]:
                value[(a >= ra) & (a < ra + rw) & (b >= rb) & (b < rb + rh)] = painted
            grey[hit] = value + Texture(k, 6, 0.07)(a, b)
            depth[hit], label[hit], normals[hit] = t[hit], LABELS[name], normal
        px, pz, radius = PILLAR
        d, o = rays[:, [0, 2]], centre[[0, 2]] - [px, pz]
        qa, qb, qc = (d * d).sum(1), d @ o, o @ o - radius * radius
        t = (-qb - np.sqrt(qb * qb - qa * qc)) / qa
        y = centre[1] + t * rays[:, 1]
        hit = (t > 0) & (t < depth) & (y > -1.5) & (y < 1.0)
        at = o + t[hit, None] * d[hit]
        grey[hit] = 90 + 40 * at[:, 0] / radius + Texture(9, 15, 0.1)(np.arctan2(at[:, 1], at[:, 0]), y[hit])
        depth[hit], label[hit] = t[hit], LABELS["pillar"]
        normals[hit] = np.column_stack([at[:, 0], np.zeros(len(at)), at[:, 1]]) / radius
    return grey, label, depth, normals


def project(pose: tuple[np.ndarray, np.ndarray], points: np.ndarray) -> np.ndarray:
    """Pixels of points (N x 3), NaN outside the image."""
    rotation, translation = pose
    x = points @ rotation.T + translation
    n = x[:, :2] / x[:, 2:]
    pixels = FOCAL * n * (1 + RADIAL * (n * n).sum(1, keepdims=True)) + [WIDTH / 2, HEIGHT / 2]
    inside = (x[:, 2] > 0.1) & (pixels > 1).all(1) & (pixels < [WIDTH - 1, HEIGHT - 1]).all(1)
    return np.where(inside[:, None], pixels, np.nan)


def rays_of(pose: tuple[np.ndarray, np.ndarray], pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Camera centre, and rays in the world through pixels (N x 2)."""
    distorted = (pixels - [WIDTH / 2, HEIGHT / 2]) / FOCAL
    n = distorted
    for _ in range(8):
        n = distorted / (1 + RADIAL * (n * n).sum(1, keepdims=True))
    rotation, translation = pose
    return -rotation.T @ translation, np.column_stack([n, np.ones(len(n))]) @ rotation


def write_png(path: pathlib.Path, grey: np.ndarray, level: int = 6) -> None:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    height, width = grey.shape
    rows = np.column_stack([np.zeros(height, np.uint8), grey])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(rows.tobytes(), level)) + chunk(b"IEND", b""))


def read_png(path: pathlib.Path) -> np.ndarray:
    """What write_png wrote."""
    data, at, packed = path.read_bytes(), 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            width, height = struct.unpack(">II", data[at + 8:at + 16])
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += 12 + size
    return np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, width + 1)[:, 1:]


def bmp_bytes(grey: np.ndarray) -> bytes:
    height, width = grey.shape
    rows = np.zeros((height, (3 * width + 3) // 4 * 4), np.uint8)
    rows[:, :3 * width] = np.repeat(grey[::-1], 3, axis=1)
    return (b"BM" + struct.pack("<IIIIiiHHIIiiII", 54 + rows.size, 0, 54, 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0) +
            rows.tobytes())


def ppm_bytes(grey: np.ndarray) -> bytes:
    return b"P6\n%d %d\n255\n" % grey.shape[::-1] + np.repeat(grey, 3, axis=1).tobytes()


def tiff_bytes(grey: np.ndarray) -> bytes:
    """Uncompressed, one strip."""
    height, width = grey.shape
    entries = [(256, width), (257, height), (258, 8), (259, 1), (262, 1), (273, 8), (277, 1), (278, height),
               (279, grey.size)]
    directory = struct.pack("<H", len(entries)) + b"".join(struct.pack("<HHII", tag, 4, 1, value)
                                                           for tag, value in entries) + struct.pack("<I", 0)
    return b"II*\0" + struct.pack("<I", 8 + grey.size) + np.ascontiguousarray(grey).tobytes() + directory


def image_name(i: int) -> str:
    return f"room/{i + 1}.png"


def surface_points(random: np.random.Generator) -> np.ndarray:
    points = []
    for origin, u, v, width, height, _ in SURFACES.values():
        ab = random.uniform([0.02, 0.02], [width - 0.02, height - 0.02], (150, 2))
        points.append(np.array(origin) + ab[:, :1] * np.array(u) + ab[:, 1:] * np.array(v))
    px, pz, radius = PILLAR
    angle, y = random.uniform(-np.pi, 0, 80), random.uniform(-0.9, 0.9, 80)
    points.append(np.column_stack([px + radius * np.cos(angle), y, pz + radius * np.sin(angle)]))
    return np.concatenate(points)


def write_scene(folder: pathlib.Path) -> None:
    """images/, model/ (COLMAP's text), and for the imports (docs/import.md) labels/, normals/, warps/, segments/ and
    line_matches.txt."""
    where = poses()
    offsets = (np.arange(SAMPLES) + 0.5) / SAMPLES
    ys, xs = np.meshgrid((np.arange(HEIGHT)[:, None] + offsets).ravel(),
                         (np.arange(WIDTH)[:, None] + offsets).ravel(), indexing="ij")
    grid = np.column_stack([xs.ravel(), ys.ravel()])
    for i, pose in enumerate(where):
        grey, label, _, _ = trace(*rays_of(pose, grid))
        shape = (HEIGHT, SAMPLES, WIDTH, SAMPLES)
        mean = grey.reshape(shape).mean((1, 3))
        noise = np.random.default_rng(100 + i).normal(0, 1.5, mean.shape)
        write_png(folder / "images" / image_name(i), np.clip(np.round(mean + noise), 0, 255).astype(np.uint8))
        write_png(folder / "labels" / image_name(i), label.reshape(shape)[:, 1, :, 1])
    (folder / "labels" / "labels.json").write_text(LABELS_JSON)
    write_model(folder / "model", where)
    write_dense(folder, where)
    write_segments(folder)


def write_model(folder: pathlib.Path, where: list) -> None:
    random = np.random.default_rng(5)
    points = surface_points(random)
    tracks: list[list[tuple[int, int]]] = [[] for _ in points]
    images = []
    for i, pose in enumerate(where):
        pixels = project(pose, points)
        shown = []
        centre = -pose[0].T @ pose[1]
        for p in np.flatnonzero(np.isfinite(pixels[:, 0])):
            # Seen if nothing lies between: a little before the point nothing is hit.
            way = points[p] - centre
            if not trace(centre, way[None])[1][0] or hit_before(centre, way):
                continue
            x, y = pixels[p] + random.normal(0, POINT_NOISE_PX, 2)
            tracks[p].append((i + 1, len(shown)))
            shown.append((x, y, p + 1))
        images.append(shown)
    kept = {p + 1 for p, track in enumerate(tracks) if len(track) >= 2}
    folder.mkdir(parents=True)
    (folder / "cameras.txt").write_text(
        f"1 SIMPLE_RADIAL {WIDTH} {HEIGHT} {FOCAL} {WIDTH / 2} {HEIGHT / 2} {RADIAL}\n")
    lines = []
    for i, (pose, shown) in enumerate(zip(where, images)):
        numbers = " ".join(repr(float(v)) for v in (*quaternion(pose[0]), *pose[1]))
        lines.append(f"{i + 1} {numbers} 1 {image_name(i)}\n")
        lines.append(" ".join(f"{x!r} {y!r} {p if p in kept else -1}" for x, y, p in
                              ((float(x), float(y), p) for x, y, p in shown)) + "\n")
    (folder / "images.txt").write_text("".join(lines))
    (folder / "points3D.txt").write_text("".join(
        f"{p + 1} " + " ".join(repr(float(v)) for v in points[p]) + " 100 100 100 0.2 " +
        " ".join(f"{image} {idx}" for image, idx in track) + "\n"
        for p, track in enumerate(tracks) if p + 1 in kept))


def write_dense(folder: pathlib.Path, where: list) -> None:
    """Normals in the camera frame, and where the pixels of each image are in each other one; a pixel of four."""
    step = 4
    xs, ys = np.meshgrid(np.arange(0, WIDTH, step) + step / 2, np.arange(0, HEIGHT, step) + step / 2)
    grid, shape = np.column_stack([xs.ravel(), ys.ravel()]), xs.shape
    for i, pose in enumerate(where):
        centre, rays = rays_of(pose, grid)
        _, label, depth, normals = trace(centre, rays)
        path = folder / "normals" / f"{image_name(i)}.npy"
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, (normals @ pose[0].T).reshape(*shape, 3).astype(np.float32))
        points = centre + np.where(label > 0, depth, 1)[:, None] * rays
        for j, other in enumerate(where):
            if i == j:
                continue
            pixels = project(other, points)
            pixels[label == 0] = np.nan
            seen = np.flatnonzero(np.isfinite(pixels[:, 0]))
            hidden = trace(*rays_of(other, pixels[seen]))[2] < 0.99 * (points[seen] @ other[0].T + other[1])[:, 2]
            pixels[seen[hidden]] = np.nan
            # Arrays count pixels from 0.
            path = folder / "warps" / image_name(i).replace("/", "-") / (image_name(j).replace("/", "-") + ".npy")
            path.parent.mkdir(parents=True, exist_ok=True)
            np.save(path, (pixels - 0.5).reshape(*shape, 2).astype(np.float32))


def hit_before(centre: np.ndarray, way: np.ndarray) -> bool:
    """Whether something is between the centre and the point at centre + way: the pillar alone can be."""
    px, pz, radius = PILLAR
    d, o = way[[0, 2]], centre[[0, 2]] - [px, pz]
    a, b, c = d @ d, d @ o, o @ o - radius * radius
    if b * b <= a * c:
        return False
    return 0 < (-b - np.sqrt(b * b - a * c)) / a < 1 - 1e-6


def seen_edges(i: int) -> dict[int, np.ndarray]:
    """Ends in pixels (2 x 2), a little short of the corners, of the edges that an image shows as a whole."""
    pose, found = poses()[i], {}
    centre = -pose[0].T @ pose[1]
    for e, (start, end) in enumerate(edges()):
        ends = project(pose, np.array([start + 0.03 * (end - start), end - 0.03 * (end - start)]))
        hidden = any(hit_before(centre, start + s * (end - start) - centre) for s in np.linspace(0, 1, 20))
        if np.isfinite(ends).all() and not hidden:
            found[e] = ends
    return found


def write_segments(folder: pathlib.Path) -> None:
    """The rectangles' sides as a detector would have them, and which are the same."""
    random = np.random.default_rng(6)
    (folder / "segments" / "room").mkdir(parents=True)
    of_edge = []
    for i in range(NUM_IMAGES):
        seen = seen_edges(i)
        rows = [" ".join(f"{v:.4f}" for v in (ends + random.normal(0, 0.2, (2, 2))).ravel()) + " 1\n"
                for ends in seen.values()]
        (folder / "segments" / f"{image_name(i)}.txt").write_text("# x1 y1 x2 y2 score\n" + "".join(rows))
        of_edge.append({e: row for row, e in enumerate(seen)})
    blocks = []
    for i in range(NUM_IMAGES):
        for j in range(i + 1, NUM_IMAGES):
            rows = [f"{of_edge[i][e]} {of_edge[j][e]} 0.1\n" for e in of_edge[i] if e in of_edge[j]]
            blocks.append(f"{image_name(i)} {image_name(j)}\n" + "".join(rows) + "\n")
    (folder / "line_matches.txt").write_text("".join(blocks))


if __name__ == "__main__":
    target = pathlib.Path(sys.argv[1])
    shutil.rmtree(target, ignore_errors=True)
    write_scene(target)
