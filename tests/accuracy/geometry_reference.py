# SPDX-License-Identifier: BSD-3-Clause
"""An independent `holba evaluate_geometry`: distances of points from triangles, points and segments, the figures about
points and lines, and ETH3D's multi-view protocol, each pair by each pair in numpy, written from docs/evaluate.md."""

import collections
import math

import numpy as np


def distances_to_segments(points: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Distances (n, m) of points (n, 3) from segments (m, 2, 3), which may be points."""
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    unit = along / np.where(length > 0, length, 1)[:, None]
    from_start = points[:, None] - ends[None, :, 0]
    t = np.clip(np.einsum("nmi,mi->nm", from_start, unit), 0, length)
    return np.linalg.norm(from_start - t[..., None] * unit, axis=2)


def distances_to_triangles(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distances (n, m) of points (n, 3) from triangles (m, 3, 3): from the plane where the weights of the corners at the
    foot of the perpendicular are all positive, else from the nearest edge."""
    edges = np.stack([distances_to_segments(points, corners[:, [i, (i + 1) % 3]]) for i in range(3)]).min(axis=0)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    uu, uv, vv = (np.einsum("mi,mi->m", a, b) for a, b in ((u, u), (u, v), (v, v)))
    area2 = uu * vv - uv * uv
    proper = area2 > 1e-14 * np.maximum(uu, vv) ** 2
    safe = np.where(proper, area2, 1)
    from_corner = points[:, None] - corners[None, :, 0]
    xu, xv = np.einsum("nmi,mi->nm", from_corner, u), np.einsum("nmi,mi->nm", from_corner, v)
    s, t = (xu * vv - xv * uv) / safe, (xv * uu - xu * uv) / safe
    foot = from_corner - s[..., None] * u - t[..., None] * v
    inside = proper & (s >= 0) & (t >= 0) & (s + t <= 1)
    return np.where(inside, np.linalg.norm(foot, axis=2), edges)


def nearest(points: np.ndarray, things: np.ndarray, step: int = 200_000) -> np.ndarray:
    """Distance (n,) of each point from the nearest of triangles (m, 3, 3) or points (m, 3)."""
    rows = max(1, step // len(things))
    parts = []
    for begin in range(0, len(points), rows):
        some = points[begin:begin + rows]
        if things.ndim == 2:
            parts.append(np.linalg.norm(some[:, None] - things, axis=2).min(axis=1))
        else:
            parts.append(distances_to_triangles(some, things).min(axis=1))
    return np.concatenate(parts)


def point_figures(distance_m: np.ndarray, thresholds_mm: list[float]) -> dict:
    return {"count": len(distance_m), "median_mm": 1000 * float(np.median(distance_m)),
            "inlier_percent": {f"{t:g}": 100 * float(np.mean(distance_m <= t / 1000)) for t in thresholds_mm}}


def line_figures(ends: np.ndarray, things: np.ndarray, num_samples: int, thresholds_mm: list[float]) -> tuple[dict, dict]:
    """In the paper's and in LIMAP's definition, of lines (n, 2, 3)."""
    t = ((np.arange(num_samples) + 0.5) / num_samples)[:, None]
    samples = ends[:, None, 0] * (1 - t) + ends[:, None, 1] * t
    distance = nearest(samples.reshape(-1, 3), things).reshape(len(ends), num_samples)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    paper = {"count": len(ends), "length_m": length.sum(), "recall_m": {}, "precision_percent": {}}
    limap = {"count": len(ends), "length_m": length.sum(), "recall_m": {}, "precision_percent": {}}
    for threshold in thresholds_mm:
        share = np.mean(distance <= threshold / 1000, axis=1)
        key = f"{threshold:g}"
        paper["recall_m"][key] = limap["recall_m"][key] = length @ share
        paper["precision_percent"][key] = 100 * (length @ share) / length.sum()
        limap["precision_percent"][key] = 100 * np.mean(share > 0)
    return paper, limap


def voxel_mean(points: np.ndarray, verdicts: list[int], size: float) -> float:
    """Mean over the voxels of two grids of the share of right points (2) among those that count (1, 2)."""
    shares = []
    for shift in (0.0, 0.5):
        voxels = collections.defaultdict(list)
        for x, verdict in zip(points, verdicts):
            voxels[tuple(math.floor(c / size + shift) for c in x)].append(verdict)
        for inside in voxels.values():
            counted = [v for v in inside if v > 0]
            if counted:
                shares.append(sum(v == 2 for v in counted) / len(counted))
    return sum(shares) / len(shares) if shares else 0.0


def multi_view(points: np.ndarray, scans: list[tuple[np.ndarray, np.ndarray, np.ndarray]], tolerances_cm: list[float],
               voxel_m: float = 0.01, start_radius_m: float = 0.001125, halfangle_deg: float = 0.011) -> dict:
    """scans: points (m, 3) in the frame of the scanner, its rotation and its position in the world."""
    scanned = np.concatenate([cloud @ R.T + t for cloud, R, t in scans])
    to_points = nearest(scanned, points)
    best, free = np.full(len(points), np.inf), np.zeros(len(points), bool)
    for cloud, R, t in scans:
        x = (points - t) @ R
        distance, reach = np.linalg.norm(x, axis=1), np.linalg.norm(cloud, axis=1)
        axis = cloud / reach[:, None]
        radius = start_radius_m + distance * math.tan(math.radians(halfangle_deg))
        along = x @ axis.T
        off = np.linalg.norm(x[:, None] - along[..., None] * axis, axis=2)
        in_beam = (along >= 0) & (off <= radius[:, None])
        near = np.where(in_beam, np.linalg.norm(x[:, None] - cloud, axis=2), np.inf)
        best = np.minimum(best, near.min(axis=1))
        free |= (in_beam & (along < reach)).any(axis=1)
    figures = {"accuracy_percent": {}, "completeness_percent": {}, "f1_percent": {}, "observed": {}}
    for cm in tolerances_cm:
        tolerance, key = cm / 100, f"{cm:g}"
        verdicts = [2 if d <= tolerance else int(f) for d, f in zip(best, free)]
        accuracy = voxel_mean(points, verdicts, voxel_m)
        completeness = voxel_mean(scanned, [2 if d <= tolerance else 1 for d in to_points], voxel_m)
        figures["accuracy_percent"][key] = 100 * accuracy
        figures["completeness_percent"][key] = 100 * completeness
        both = accuracy + completeness
        figures["f1_percent"][key] = 200 * accuracy * completeness / both if both else 0.0
        figures["observed"][key] = sum(v > 0 for v in verdicts)
    return figures
