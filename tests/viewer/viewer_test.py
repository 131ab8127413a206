#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The page of 'holba view'. Usage: viewer_test.py page|browser VIEWER_FOLDER WORK_FOLDER HOLBA

page: its sources give the committed bytes. browser: what it does in chromium (viewer/test/viewer_test.mjs).
Exit status 77: skipped, with the reason."""

import os
import pathlib
import shutil
import subprocess
import sys

SKIPPED = 77
BROWSERS = ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome")


def skip(reason: str) -> None:
    print(f"SKIPPED: {reason}")
    sys.exit(SKIPPED)


def prepare(viewer: pathlib.Path, work: pathlib.Path) -> None:
    """Sources and packages in `work`, so that nothing is written beside the sources."""
    for program in ("node", "npm"):
        if shutil.which(program) is None:
            skip(f"there is no {program}")
    work.mkdir(parents=True, exist_ok=True)
    for entry in viewer.iterdir():
        if entry.name in ("node_modules", "page"):
            continue
        target = work / entry.name
        if entry.is_dir():
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(entry, target)
        else:
            shutil.copy(entry, target)
    stamp = work / "node_modules" / ".lock-of-these"
    lock = (viewer / "package-lock.json").read_bytes()
    if not stamp.exists() or stamp.read_bytes() != lock:
        done = subprocess.run(["npm", "ci", "--no-audit", "--no-fund"], cwd=work, check=False)
        if done.returncode != 0:
            skip("npm could not install the viewer's packages")
        stamp.write_bytes(lock)


def main() -> int:
    part, viewer, work, holba = sys.argv[1], *map(pathlib.Path, sys.argv[2:5])
    prepare(viewer, work)
    if part == "page":
        subprocess.run(["npm", "run", "build"], cwd=work, check=True)
        if (work / "page" / "viewer.html").read_bytes() == (viewer / "page" / "viewer.html").read_bytes():
            return 0
        print("viewer/page/viewer.html is not what its sources give; run 'npm ci && npm run build' in viewer/ and commit it")
        return 1
    browser = os.environ.get("HOLBA_CHROMIUM") or next(filter(os.path.exists, BROWSERS), None)
    if browser is None:
        skip("there is no chromium")
    environment = dict(os.environ, HOLBA=str(holba), HOLBA_CHROMIUM=browser)
    return subprocess.run(["node", "--test", "test/viewer_test.mjs"], cwd=work, env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
