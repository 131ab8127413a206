# SPDX-License-Identifier: BSD-3-Clause
"""holba adjust under mpirun: the optimum of one process, and what happens when things go wrong.

Usage: mpi_test.py HOLBA MPIEXEC.
"""
import filecmp
import json
import os
import pathlib
import resource
import signal
import subprocess
import sys
import tempfile
import time
import unittest

HOLBA, MPIEXEC = sys.argv[1:3]
ENVIRONMENT = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                   OMPI_MCA_btl_base_warn_component_unused="0")
LIMITS = ["--Solver.num_threads", "1"]


def command(ranks, *arguments):
    launcher = [MPIEXEC, "--oversubscribe", "-n", str(ranks)] if ranks else []
    return launcher + [HOLBA, *map(str, arguments)]


def run(ranks, *arguments, **options):
    return subprocess.run(command(ranks, *arguments), env=ENVIRONMENT, capture_output=True, text=True,
                          timeout=600, check=False, **options)


def processes_of(text):
    """Process ids of holba whose command line has `text`, with their parents'."""
    found = {}
    for folder in pathlib.Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        try:
            line = (folder / "cmdline").read_bytes().split(b"\0")
            if line[0].decode() == HOLBA and text.encode() in line:
                status = (folder / "status").read_text()
                found[int(folder.name)] = int(status.split("PPid:")[1].split()[0])
        except (OSError, IndexError):
            pass
    return found


class Mpi(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        made = run(0, "synthesize", "--output_path", cls.folder / "scene", "--num_images", "20", "--vps", "1")
        assert made.returncode == 0, made.stderr
        cls.input = cls.folder / "scene" / "perturbed"

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def adjust(self, ranks, output, *arguments, backend="petsc", **options):
        return run(ranks, "adjust", "--input_path", self.input, "--output_path", output, "--Solver.backend", backend,
                   *LIMITS, *arguments, **options)

    def same_model(self, a, b):
        names = sorted(path.name for path in a.iterdir())
        self.assertEqual(names, sorted(path.name for path in b.iterdir()))
        self.assertEqual(filecmp.cmpfiles(a, b, names, shallow=False)[1:], ([], []))

    def test_several_ranks_find_the_optimum_of_one_process(self):
        results = {}
        for name, ranks, backend in (("native", 0, "native"), ("alone", 0, "petsc"), ("two", 2, "petsc")):
            done = self.adjust(ranks, self.folder / name, "--json", "--Solver.function_tolerance", "1e-12",
                               backend=backend)
            self.assertEqual(done.returncode, 0, done.stderr)
            results[name] = json.loads(done.stdout)
        for name in ("alone", "two"):
            self.assertLess(abs(results[name]["cost"]["final"] / results["native"]["cost"]["final"] - 1.0), 1e-9)
            self.assertEqual(results[name]["backend"], "petsc")
        self.assertEqual(len(results["two"]["ranks"]), 2)
        self.assertGreater(results["two"]["ranks"][0]["bytes_per_iteration"], 0)
        self.assertEqual(results["alone"]["ranks"], [])

    def test_a_bad_input_is_said_once(self):
        done = run(2, "adjust", "--input_path", self.folder / "nowhere", "--output_path", self.folder / "x",
                   "--Solver.backend", "petsc")
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stderr.count("there is no such file"), 1, done.stderr)
        self.assertFalse((self.folder / "x").exists())

    def test_other_solvers_and_commands_refuse_several_processes(self):
        done = self.adjust(2, self.folder / "x", backend="native")
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stderr.count("expected --Solver.backend petsc"), 1, done.stderr)
        done = run(2, "evaluate", "--input_path", self.input)
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stderr.count("expected a start without mpirun"), 1, done.stderr)

    def test_options_reach_petsc_and_misspelt_ones_are_named(self):
        done = self.adjust(0, self.folder / "options", "--json", "--petsc=-mat_type aij -pc_type asm -pc_tipe x")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("asm", json.loads(done.stdout)["linear_solver"])
        self.assertIn("-pc_tipe", done.stderr)
        self.assertEqual(self.adjust(0, self.folder / "x", "--petsc=-pc_type asm", backend="native").returncode, 1)

    def test_a_killed_rank_loses_nothing(self):
        undisturbed = self.folder / "undisturbed"
        self.assertEqual(self.adjust(2, undisturbed).returncode, 0)
        output, checkpoint = self.folder / "output", self.folder / "checkpoint"
        output.mkdir()
        (output / "cameras.bin").write_bytes(b"old")
        arguments = ("--checkpoint_path", checkpoint, "--checkpoint_iterations", "1")
        job = subprocess.Popen(command(2, "adjust", "--input_path", self.input, "--output_path", output,
                                       "--Solver.backend", "petsc", *LIMITS, *arguments),
                               env=ENVIRONMENT, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        while not (checkpoint / "solve_0001.bin").exists():
            self.assertIsNone(job.poll(), "it ended before it could be killed")
            time.sleep(0.001)
        found = processes_of(str(output))
        ranks = [pid for pid, parent in found.items() if parent in found]
        self.assertEqual(len(ranks), 2)
        os.kill(ranks[1], signal.SIGKILL)
        _, errors = job.communicate(timeout=120)
        self.assertEqual(job.returncode, 2, errors)
        self.assertIn("was killed by signal 9", errors)
        self.assertEqual((output / "cameras.bin").read_bytes(), b"old")
        (output / "cameras.bin").unlink()
        done = self.adjust(2, output, *arguments, "--resume", "1")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.same_model(output, undisturbed)
        self.assertFalse(checkpoint.exists())

    def test_a_full_disk_ends_the_job_with_a_sentence(self):
        def small_files():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
        # MPI itself needs larger files than this limit allows: one process, without it.
        done = self.adjust(0, self.folder / "full", "--checkpoint_path", self.folder / "full_checkpoint",
                           "--checkpoint_iterations", "1", backend="native", preexec_fn=small_files)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("full_checkpoint", done.stderr)
        self.assertFalse((self.folder / "full").exists())

    def test_a_checkpoint_cut_in_half_is_refused(self):
        checkpoint = self.folder / "cut"
        checkpoint.mkdir()
        (checkpoint / "solve_0000.bin").write_bytes(b"holba checkpoint 1\n" + bytes(40))
        done = self.adjust(0, self.folder / "x", "--checkpoint_path", checkpoint, "--resume", "1", backend="native")
        self.assertEqual(done.returncode, 1)
        self.assertTrue("cut short" in done.stderr or "damaged" in done.stderr, done.stderr)
        self.assertTrue((checkpoint / "solve_0000.bin").exists())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
