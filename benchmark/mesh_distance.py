# SPDX-License-Identifier: BSD-3-Clause
"""Exact distances of points to the triangles of a mesh, up to a limit. Needs numpy."""

import pathlib
import sys

import numpy as np

LEAF = 4  # triangles of a leaf
MAX_PAIRS = 200_000  # tests of a point and a triangle at once: some 100 MB


def read_mesh(path: pathlib.Path) -> np.ndarray:
    """Triangles (n, 3 corners, 3) of a binary PLY whose vertices are three floats and whose faces are triangles. Ends
    the program with what was expected on any other file."""
    data = path.read_bytes()
    header, end = [], 0
    while not header or header[-1] != "end_header":
        stop = data.find(b"\n", end)
        if stop < 0:
            sys.exit(f"{path}: no end_header, so this is no PLY file")
        header.append(data[end:stop].decode("ascii", "replace").strip())
        end = stop + 1
    counts = {words[1]: int(words[2]) for words in map(str.split, header) if words[:1] == ["element"]}
    properties = [line for line in header if line.startswith("property")]
    if "format binary_little_endian 1.0" not in header or properties != [
            "property float x", "property float y", "property float z", "property list uchar int vertex_indices"]:
        sys.exit(f"{path}: expected a binary little-endian PLY with vertices 'float x y z' and faces "
                 "'list uchar int vertex_indices'")
    vertices = np.frombuffer(data, "<f4", 3 * counts["vertex"], end).reshape(-1, 3).astype(float)
    faces = np.frombuffer(data, np.dtype([("size", "u1"), ("corners", "<i4", 3)]), counts["face"],
                          end + 12 * counts["vertex"])
    if not (faces["size"] == 3).all():
        sys.exit(f"{path}: expected triangles only")
    return vertices[faces["corners"]]


def squared_distances(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Squared distances (n, k) of points (n, k, 3) to one triangle (n, 3, 3) for each row: to its plane where the foot
    of the perpendicular is inside, else to the nearest edge. A triangle without area is its edges."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    best = np.full(points.shape[:2], np.inf)
    inside = np.broadcast_to((normal != 0).any(axis=1)[:, None], best.shape).copy()
    for i in range(3):
        from_corner = points - triangles[:, None, i]
        edge = triangles[:, (i + 1) % 3] - triangles[:, i]
        length2 = np.maximum((edge * edge).sum(axis=1), 1e-300)
        t = np.clip(np.einsum("nki,ni->nk", from_corner, edge) / length2[:, None], 0, 1)
        off = from_corner - t[..., None] * edge[:, None]
        best = np.minimum(best, np.einsum("nki,nki->nk", off, off))
        inside &= np.einsum("nki,ni->nk", from_corner, np.cross(normal, edge)) >= 0
    height = np.einsum("nki,ni->nk", from_corner, normal)
    plane = height * height / np.maximum((normal * normal).sum(axis=1), 1e-300)[:, None]
    return np.where(inside, plane, best)


class MeshDistance:
    """A hierarchy of boxes over triangles (n, 3, 3) that are sorted along a space-filling curve: nodes 2 i and 2 i + 1
    of a level are the children of node i of the level above."""

    def __init__(self, triangles: np.ndarray):
        centres = triangles.mean(axis=1)
        low, high = centres.min(axis=0), centres.max(axis=0)
        cells = ((centres - low) / np.maximum(high - low, 1e-300) * 1023).astype(np.int64)
        code = np.zeros(len(cells), np.int64)
        for bit in range(10):
            for axis in range(3):
                code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
        size = LEAF
        while size < len(triangles):
            size *= 2
        order = np.argsort(code, kind="stable")
        # The last triangle again and again fills the last leaves; it changes no distance.
        self.triangles = triangles[np.concatenate([order, np.full(size - len(order), order[-1])])]
        low = self.triangles.reshape(-1, 3 * LEAF, 3).min(axis=1)
        high = self.triangles.reshape(-1, 3 * LEAF, 3).max(axis=1)
        self.levels = [(low, high)]
        while len(low) > 1:
            low, high = np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])
            self.levels.append((low, high))
        self.levels.reverse()

    def _leaves_near(self, centres: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of a centre (sorted) and a leaf whose box is within its reach."""
        query, node = np.arange(len(centres)), np.zeros(len(centres), np.int64)
        for i, (low, high) in enumerate(self.levels):
            if i > 0:
                query = np.repeat(query, 2)
                node = (2 * node[:, None] + np.arange(2)).ravel()
            centre = centres[query]
            off = np.maximum(np.maximum(low[node] - centre, centre - high[node]), 0)
            keep = np.einsum("ni,ni->n", off, off) <= reach[query] ** 2
            query, node = query[keep], node[keep]
        return query, node

    def distances(self, points: np.ndarray, limit: float) -> np.ndarray:
        """Distances (n, k) of points (n, k, 3), where the k points of a row are near one another and are looked for
        together; inf above the limit."""
        result = np.full(points.shape[:2], np.inf)
        centres = points.mean(axis=1)
        reach = np.linalg.norm(points - centres[:, None], axis=2).max(axis=1) * (1 + 1e-9) + limit
        for begin in range(0, len(points), 1024):
            rows = np.arange(begin, min(begin + 1024, len(points)))
            query, leaf = self._leaves_near(centres[rows], reach[rows])
            step = max(1, MAX_PAIRS // (LEAF * points.shape[1]))
            for first in range(0, len(query), step):
                row = rows[query[first:first + step]]
                for i in range(LEAF):
                    squared = squared_distances(points[row], self.triangles[LEAF * leaf[first:first + step] + i])
                    starts = np.flatnonzero(np.r_[True, row[1:] != row[:-1]])
                    found = np.sqrt(np.minimum.reduceat(squared, starts, axis=0))
                    result[row[starts]] = np.minimum(result[row[starts]], found)
        result[result > limit] = np.inf
        return result
