# SPDX-License-Identifier: BSD-3-Clause
"""A scene with a torus and a Bezier curve, its adjustment, and a picture: torus_and_curve.py PICTURE.svg

Cameras are those of `holba synthesize`; points of a torus and of a curve are seen by all of them with 1 px of noise. The start is
off by several times what the photographs tell. Prints how far the groups are from the true ones before and after `adjust`.
"""

import pathlib
import sys
import tempfile

import holba
import numpy as np

TORUS = [0.4, -0.3, 0.2, 0.0, 0.6, 0.8, 1.2, 0.35]  # cx cy cz dx dy dz R r
CURVE = [-2.0, -1.0, 0.5, -0.8, 1.2, 0.9, 0.9, 0.4, 1.4, 2.0, 1.6, 0.8]


def torus_points(rng, count):
    c, d, (R, r) = np.array(TORUS[:3]), np.array(TORUS[3:6]), TORUS[6:]
    e1 = np.cross(d, [1.0, 0.0, 0.0])
    e1 /= np.linalg.norm(e1)
    theta, phi = rng.uniform(0, 2 * np.pi, (2, count, 1))
    e = np.cos(theta) * e1 + np.sin(theta) * np.cross(d, e1)
    return c + (R + r * np.cos(phi)) * e + r * np.sin(phi) * d


def curve_points(rng, count):
    t = rng.uniform(0, 1, (count, 1))
    p = np.array(CURVE).reshape(4, 3)
    return (1 - t) ** 3 * p[0] + 3 * (1 - t) ** 2 * t * p[1] + 3 * (1 - t) * t**2 * p[2] + t**3 * p[3]


def make_scene(folder, num_images=12, count=60, seed=1):
    """Truth and start of an adjustment, and the ids of the torus and of the curve in both."""
    rng = np.random.default_rng(seed)
    holba.synthesize(output_path=folder, num_images=num_images, seed=seed)
    truth, start = (holba.read_model(pathlib.Path(folder) / name) for name in ("truth", "perturbed"))
    groups = []
    for kind, params, points in (("TORUS", TORUS, torus_points(rng, count)), ("BEZIER_CURVE", CURVE, curve_points(rng, count))):
        members = []
        for xyz in points:
            track = []
            for image_id, image in truth.images.items():
                pixel = truth.cameras[image.camera_id].project((image.cam_from_world * xyz)[None])[0]
                if not np.isfinite(pixel).all():
                    continue
                pixel += rng.normal(scale=1.0, size=2)
                for model in (truth, start):
                    idx = model.add_point2D(image_id, pixel)
                track.append((image_id, idx))
            noisy = xyz + rng.normal(scale=0.05, size=3)
            members.append(truth.add_point3D(xyz, track))
            start.add_point3D(noisy, track)
        wrong = np.array(params)
        wrong[:3] += rng.normal(scale=0.05, size=3)
        wrong[-2:] *= 1.1
        groups.append(truth.add_group3D(kind, params, members))
        start.add_group3D(kind, wrong, members)
    return truth, start, groups


def distance_from_truth(model, truth, group_id):
    """Root mean square distance of the members from the true points, in the frame of the truth."""
    ids = model.groups3D[group_id].point3D_ids
    off = [model.points3D[i].xyz - truth.points3D[i].xyz for i in ids]
    return float(np.sqrt(np.mean(np.sum(np.square(off), axis=1))))


def surfaces(model, folder):
    """Triangles (n, 3, 3) of all groups, as `holba convert` draws them."""
    path = pathlib.Path(folder) / "groups.obj"
    holba.convert(model, path, output_type="obj")
    vertices, triangles = [], []
    for line in path.read_text().splitlines():
        words = line.split()
        if line.startswith("v "):
            vertices.append([float(w) for w in words[1:4]])
        elif line.startswith("f "):
            triangles.append([int(w.split("/")[0]) - 1 for w in words[1:4]])
    return np.array(vertices)[np.array(triangles)]


def draw(model, groups, folder, picture):
    """Both groups from one side, far triangles first, and their members."""
    shown = model.copy()
    members = [np.array([shown.points3D[i].xyz for i in shown.groups3D[g].point3D_ids]) for g in groups]
    for other in [i for i in shown.groups3D if i not in groups]:
        shown.delete_group3D(other)
    for line in list(shown.lines3D):
        shown.delete_line3D(line)
    view = np.array([0.5, 0.0, 0.9])
    view /= np.linalg.norm(view)
    right = np.cross([0, 0, 1.0], -view)
    right /= np.linalg.norm(right)
    up = np.cross(right, -view)
    triangles = surfaces(shown, folder)
    flat = lambda X: np.stack([X @ right, -(X @ up)], axis=-1) * 100 + [300, 175]  # noqa: E731
    lines = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 600 400">', '<rect width="600" height="400" fill="white"/>']
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    facing = normals @ view / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    lines.append('<g fill-opacity="0.7">')
    for k in np.argsort(triangles.mean(axis=1) @ view):
        if facing[k] <= 0:
            continue
        path = " ".join(f"{x:.0f},{y:.0f}" for x, y in flat(triangles[k]))
        shade = int(150 + 90 * facing[k])
        lines.append(f'<polygon points="{path}" fill="#{shade - 80:02x}{shade - 30:02x}{shade:02x}"/>')
    lines.append("</g>")
    for points, colour in zip(members, ("#8a1c1c", "#b35c00")):
        lines += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.2" fill="{colour}"/>' for x, y in flat(points)]
    pathlib.Path(picture).write_text("\n".join([*lines, "</svg>"]) + "\n")


def main():
    with tempfile.TemporaryDirectory() as folder:
        truth, model, groups = make_scene(folder)
        before = [distance_from_truth(model, truth, g) for g in groups]
        holba.adjust(model)
        model.transform(holba.align(model, truth))
        for name, g, was in zip(("torus", "curve"), groups, before):
            print(f"{name}: members off by {was:.4f} before, {distance_from_truth(model, truth, g):.4f} after")
        print("R r of the torus:", *np.round(model.groups3D[groups[0]].params[-2:], 4), "true:", *TORUS[-2:])
        draw(model, groups, folder, sys.argv[1])


if __name__ == "__main__":
    main()
