# SPDX-License-Identifier: BSD-3-Clause
"""A small holistic model as text (FORMAT of docs/): two images of two points and two lines on the plane
z = 4, with a vanishing point and a plane that are orthogonal to each other. Numbers have up to 17 digits."""

import pathlib

CAMERAS = """# Camera list
1 SIMPLE_PINHOLE 640 480 500 320 240
2 OPENCV 800 600 500.10000000000002 501 400 300 0.01 -0.02 0.001 0.002
"""

# Camera centres (0, 0, 0) and (1, 0, 0), no rotation.
IMAGES = """# Image list
1 1 0 0 0 0 0 0 1 first.jpg
320 240 1 445 240 2 10.5 20.25 -1
2 1 0 0 0 -1 0 0 2 sub folder/second.jpg
275.125 300.0625 1 400.33333333333331 300 2
"""

POINTS3D = """# 3D point list
1 0 0 4 255 128 0 0.10000000000000001 1 0 2 0
2 1 0 4 1 2 3 -1 1 1 2 1
"""

LINES2D = """# Segments
1 3 320 240 445 240 1 320 100 320 300 2 1.5 2.5 3.5 4.5 -1
2 2 275 300 400 300 1 280.10000000000002 110 279 310 2
"""

# Through (0, 0, 4) along x: m = p x d = (0, 4, 0); along y: m = (-4, 0, 0).
LINES3D = """# Lines
1 1 0 0 0 4 0 0 0 4 1 0 4 10 20 30 0.5 1 0 2 0
2 0 1 0 -4 0 0 0 -1 4 0 1 4 40 50 60 -1 1 1 2 1
"""

GROUPS2D = """# Observations of groups
1 0 PLANE 2 2 0 1 2 0 1
1 1 VP 1 0 1 0
2 0 VP 1 0 1 0
"""

GROUPS3D = """# Groups
1 VP 3 1 0 0 0 1 1 2 1 1 2 0
2 PLANE 4 0 0 1 -4 2 1 2 2 1 2 1 1 0
"""

WIREFRAME = """# Edges
1 1 2
2 1 2
"""

RELATIONS = """# Relations
1 2 ORTHOGONAL
"""

SMALL_MODEL = {
    "cameras": CAMERAS, "images": IMAGES, "points3D": POINTS3D, "lines2D": LINES2D, "lines3D": LINES3D,
    "groups2D": GROUPS2D, "groups3D": GROUPS3D, "wireframe": WIREFRAME, "relations": RELATIONS,
}


def write_small_model(folder: pathlib.Path, changes: dict[str, str] | None = None) -> None:
    """Writes the model to `folder`; changes: text of some files, without their ending."""
    folder.mkdir(parents=True)
    files = {**SMALL_MODEL, **(changes or {})}
    if changes and "points3D" in changes:  # points without tracks: nothing may refer to them
        files = {name: files[name] for name in ("cameras", "points3D")}
        files["images"] = IMAGES.split("320 240 1")[0] + "\n" + IMAGES.split("-1\n")[1].split("275")[0] + "\n"
    for name, text in files.items():
        (folder / f"{name}.txt").write_text(text)
