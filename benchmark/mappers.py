# SPDX-License-Identifier: BSD-3-Clause
"""Mappers on a COLMAP database, as mapping_scale.py and mapping_sets.py compare them: holba with points alone and with
structure, COLMAP's mapper, and COLMAP 4 through pycolmap. Standard library only.

A mapper is a function (Job) -> seconds of processor time in user mode, which leaves a model, or models 0, 1, ..., in
job.output; it raises MapperFailed if there is none. Results of peers are kept in a cache, which is told apart by the
database's contents, so that a table can be made anew after a change of holba alone.
"""

import dataclasses
import hashlib
import json
import math
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from typing import Callable

from real_sets import THRESHOLDS_DEG, run

HELD = ["--Mapper.ba_refine_focal_length", "0", "--Mapper.ba_refine_extra_params", "0"]
STRUCTURES = ["none", "lines", "groups", "holistic"]


class MapperFailed(Exception):
    pass


@dataclasses.dataclass
class Job:
    database: pathlib.Path  # a copy of its own: mappers may write to it
    output: pathlib.Path
    images: pathlib.Path | None  # the photographs; none: there are none
    known: bool  # intrinsics are right and held
    limit_seconds: float  # of wall time


def user_seconds_of(command: list, limit_seconds: float) -> tuple[float, str]:
    """Processor time in user mode of a program with its children, and what it printed on stdout."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        process = subprocess.Popen([str(word) for word in command], stdout=out, stderr=err, start_new_session=True)
        end = time.monotonic() + limit_seconds
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid != 0:
                break
            if time.monotonic() > end:
                os.killpg(process.pid, signal.SIGKILL)
                os.wait4(process.pid, 0)
                process.returncode = -signal.SIGKILL
                raise MapperFailed(f"took longer than {limit_seconds:.0f} s")
            time.sleep(0.02)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        if process.returncode != 0:
            lines = err.read().strip().splitlines()
            raise MapperFailed(lines[-1] if lines else f"exit status {process.returncode}")
        return usage.ru_utime, out.read()


def holba_mapper(holba: str, structure: str, options: list[str]) -> Callable[[Job], float]:
    def map_images(job: Job) -> float:
        words = ["--Mapper.structure", structure, *options]
        if job.known:
            words += [*HELD, "--Bundle.refine_focal_length", "0", "--Bundle.refine_extra_params", "0",
                      "--Bundle.refine_principal_point", "0"]
        if job.images is not None:
            words += ["--image_path", job.images]
        return user_seconds_of([holba, "map", "--database_path", job.database, "--output_path", job.output, "--quiet",
                                *words], job.limit_seconds)[0]
    return map_images


def colmap_mapper(colmap: str, refiner: str | None = None) -> Callable[[Job], float]:
    """refiner: an interpreter with pycolmap, which adjusts the largest model as pycolmap_mapper.py --refine."""
    def map_images(job: Job) -> float:
        sparse = job.output / "sparse"
        sparse.mkdir(parents=True)
        seconds, _ = user_seconds_of([colmap, "mapper", "--database_path", job.database, "--image_path",
                                      job.images or job.output, "--output_path", sparse,
                                      *(HELD if job.known else [])], job.limit_seconds)
        # The one with the largest file of images has the most of them.
        models = sorted(sparse.glob("*/images.bin"), key=lambda path: path.stat().st_size)
        if not models:
            raise MapperFailed("no model")
        if refiner is None:
            for model in sparse.iterdir():
                model.rename(job.output / model.name)
            sparse.rmdir()
            return seconds
        result = pycolmap_run(refiner, job, ["--input", models[-1].parent, "--refine"])
        shutil.rmtree(sparse)
        return seconds + result["refine_seconds"]
    return map_images


def pycolmap_run(python: str, job: Job, options: list) -> dict:
    script = pathlib.Path(__file__).parent / "pycolmap_mapper.py"
    words = [*options, *(["--known"] if job.known else []), *(["--images", job.images] if job.images else [])]
    _, text = user_seconds_of([python, script, job.database, job.output, *words], job.limit_seconds)
    result = json.loads(text.strip().splitlines()[-1])
    if result["images"] == 0:
        raise MapperFailed("no model")
    return result


def pycolmap_mapper(python: str, kind: str, refined: bool = False) -> Callable[[Job], float]:
    def map_images(job: Job) -> float:
        result = pycolmap_run(python, job, ["--mapper", kind, *(["--refine"] if refined else [])])
        return result["map_seconds"] + result["refine_seconds"]
    return map_images


def content_of(path: pathlib.Path) -> str:
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()[:16]


@dataclasses.dataclass
class Score:
    seconds: float = math.nan
    registered: int = 0
    images: int = 0
    auc: dict[str, float] = dataclasses.field(default_factory=dict)
    failure: str = ""

    def cells(self) -> list[str]:
        """Registered images, user seconds, AUC: as HEADER says."""
        if self.failure:
            return [self.failure[:40], "-", *["-"] * len(THRESHOLDS_DEG)]
        return [f"{self.registered} of {self.images}", f"{self.seconds:.1f}",
                *(f"{self.auc[t]:.1f}" for t in THRESHOLDS_DEG)]


HEADER = ["registered", "user s", *(f"@{t}" for t in THRESHOLDS_DEG)]


class Bench:
    """Runs mappers in folders of their own and judges their models with `holba evaluate_poses`."""

    def __init__(self, holba: str, folder: pathlib.Path, cache: pathlib.Path, limit_seconds: float):
        self.holba = holba
        self.folder = folder
        self.cache = cache
        self.limit_seconds = limit_seconds

    def score(self, title: str, mapper: Callable[[Job], float], database: pathlib.Path, truth: pathlib.Path,
              images: pathlib.Path | None, known: bool, is_peer: bool) -> Score:
        name = f"{database.stem}-{'known' if known else 'unknown'}-{title}".replace(" ", "_").replace(",", "")
        kept = self.cache / f"{name}-{content_of(database)}.json"
        if is_peer and kept.exists():
            return Score(**json.loads(kept.read_text()))
        print(f"{database.stem}: {title}", file=sys.stderr, flush=True)
        output = self.folder / name
        shutil.rmtree(output, ignore_errors=True)
        output.mkdir(parents=True)
        copy = self.folder / f"{name}.db"
        shutil.copy(database, copy)
        score = Score()
        try:
            score.seconds = mapper(Job(copy, output, images, known, self.limit_seconds))
            errors = run(self.holba, "evaluate_poses", "--input_path", output, "--ground_truth_path", truth,
                         "--thresholds_deg", ",".join(THRESHOLDS_DEG))
            score.registered, score.images, score.auc = errors["registered"], errors["images"], errors["auc"]
        except MapperFailed as failure:
            score.failure = str(failure)
        for path in self.folder.glob(f"{name}.db*"):
            path.unlink()
        if is_peer:
            self.cache.mkdir(parents=True, exist_ok=True)
            kept.write_text(json.dumps(dataclasses.asdict(score)))
        return score


def growth_exponent(sizes: list[int], values: list[float]) -> float | None:
    """Slope of log(values) over log(sizes), by least squares. None: fewer than two sizes."""
    points = [(math.log(s), math.log(v)) for s, v in zip(sizes, values) if v > 0]
    if len({x for x, _ in points}) < 2:
        return None
    mean_x = sum(x for x, _ in points) / len(points)
    mean_y = sum(y for _, y in points) / len(points)
    return sum((x - mean_x) * (y - mean_y) for x, y in points) / sum((x - mean_x) ** 2 for x, _ in points)


def add_arguments(parser) -> None:
    """What both programs are told."""
    parser.add_argument("--holba", default=str(pathlib.Path(__file__).parent.parent / "build" / "bin" / "holba"),
                        help="the program (default: build/bin/holba)")
    parser.add_argument("--colmap", help="the program colmap (default: left out)")
    parser.add_argument("--pycolmap", help="an interpreter with pycolmap 4.2 (default: left out)")
    parser.add_argument("--structures", default=",".join(STRUCTURES), help="--Mapper.structure of `holba map`")
    parser.add_argument("--output", type=pathlib.Path, required=True,
                        help="folder for databases, models and the peers' results, which are kept there")
    parser.add_argument("--limit_seconds", type=float, default=3600.0, help="wall time of one run at most")
    parser.add_argument("options", nargs="*", help="further options of `holba map`, after --")
