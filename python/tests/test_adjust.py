# SPDX-License-Identifier: BSD-3-Clause
"""Adjustments: the program's results, its options and messages; callbacks, signals, threads."""

import inspect
import logging
import os
import pathlib
import signal
import subprocess
import threading
import time

import holba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

PROGRAM = os.environ.get("HOLBA_PROGRAM", "")


def folder(model, path: pathlib.Path) -> dict:
    model.write(path)
    return {p.name: p.read_bytes() for p in path.iterdir()}


@pytest.mark.skipif(not PROGRAM, reason="HOLBA_PROGRAM names no program")
def test_adjust_gives_the_bits_that_the_program_gives(scene, model, tmp_path):
    subprocess.run(
        [PROGRAM, "adjust", "--input_path", scene / "perturbed", "--output_path", tmp_path / "program",
         "--Bundle.refine_focal_length", "0", "--Solver.max_num_iterations", "20", "--quiet"],
        check=True, stdout=subprocess.DEVNULL,
    )
    holba.adjust(model, refine_focal_length=False, max_num_iterations=20)
    program = {p.name: p.read_bytes() for p in (tmp_path / "program").iterdir()}
    assert folder(model, tmp_path / "python") == program


def test_adjustment_brings_the_model_to_the_truth(scene, model):
    truth = holba.read_model(scene / "truth")
    before = holba.compare_to_truth(model, truth).values["position_rms"]
    summary = holba.adjust(model, refine_focal_length=False)
    after = holba.compare_to_truth(model, truth).values["position_rms"]
    assert after < 0.2 * before
    assert summary.final_cost < summary.initial_cost and summary.iterations > 0
    assert summary.stop_reason in ("converged", "no_step")
    assert set(summary.final_terms) >= {"point", "line", "group_point", "vp"}
    assert model.find_inconsistency() is None


def test_arrays_show_the_model_through_an_adjustment(model):
    xyz = model.points3D.xyz(copy=False)
    before = xyz.copy()
    holba.adjust(model, config="point", max_num_iterations=3)
    assert np.abs(xyz - before).max() > 0
    assert_array_equal(xyz, model.points3D.xyz(copy=True))


def test_options_are_keywords_by_their_last_or_whole_names(model):
    assert {o.keyword for o in holba.options("adjust")} >= {"config", "max_num_iterations", "point_loss"}
    names = [o.keyword for o in holba.options("adjust")]
    assert len(names) == len(set(names))
    option = next(o for o in holba.options("adjust") if o.keyword == "backend")
    assert option.name == "Solver.backend" and "native" in option.choices
    start = model.copy()
    a, b, c = start.copy(), start.copy(), start.copy()
    holba.adjust(a, max_num_iterations=1, config="point")
    holba.adjust(b, solver_max_num_iterations=1, bundle_config="point")
    holba.adjust(c, **{"Solver.max_num_iterations": 1, "Bundle.config": "point"})
    assert_array_equal(a.points3D.xyz(), b.points3D.xyz())
    assert_array_equal(a.points3D.xyz(), c.points3D.xyz())


@pytest.mark.parametrize("command", ["adjust", "solve", *holba.commands()])
def test_every_table_has_keywords_that_are_one_each_and_defaults_that_are_allowed(command):
    if command == "adjust":
        made = holba._core.AdjustOptions()
    else:
        made = None
    options = holba.options(command)
    assert len({o.keyword for o in options}) == len(options)
    for option in options:
        assert option.keyword.isidentifier() and option.sentence
        if made is not None:
            made.set(option.name, option.default)
            assert made.get(option.name) == option.default


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"max_num_iterations": -1}, "at least 0, found '-1'"),
        ({"max_num_iterations": 1.5}, "whole number"),
        ({"config": "points"}, r"point\|point_line\|groups\|holistic"),
        ({"gate": "maybe"}, "0 or 1"),
        ({"function_tolerance": float("nan")}, "a number"),
        ({"max_num_iteration": 3}, "did you mean 'max_num_iterations'"),
    ],
)
def test_a_value_that_is_not_allowed_is_an_input_error_in_the_words_of_the_program(model, given, message):
    before = model.points3D.xyz(copy=True)
    with pytest.raises(holba.InputError, match=message):
        holba.adjust(model, **given)
    assert_array_equal(model.points3D.xyz(), before)


def test_numbers_of_numpy_are_numbers(model):
    holba.adjust(model, max_num_iterations=np.int64(1), function_tolerance=np.float64(1e-3), gate=False)


def test_what_is_told_of_iterations_is_what_the_summary_says(model):
    records = []
    summary = holba.adjust(model, config="point", refit_others=False, choose_weights=False, on_iteration=records.append)
    assert sum(r.iteration > 0 for r in records) == summary.iterations
    assert_allclose(records[-1].cost, summary.final_cost, rtol=1e-9)
    assert set(records[0].terms) == {"point"}


def test_a_callback_that_says_false_ends_the_adjustment(model):
    seen = []

    def stop(record):
        seen.append(record)
        return len(seen) < 3

    summary = holba.adjust(model, on_iteration=stop)
    assert len(seen) == 3 and summary.stop_reason == "stopped_by_caller"
    assert model.find_inconsistency() is None


def test_an_exception_of_a_callback_comes_out_and_the_model_is_consistent(model):
    def fail(record):
        raise KeyError("of the callback")

    with pytest.raises(KeyError, match="of the callback"):
        holba.adjust(model, on_iteration=fail)
    assert model.find_inconsistency() is None


def interrupt_during(call, delay_seconds=0.0, started=None):
    """Sends this process a Ctrl-C once the call has begun."""

    def send():
        if started is not None:
            started.wait()
        time.sleep(delay_seconds)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            call()
            time.sleep(30)  # where the signal was late, it ends this
    finally:
        thread.join()


def test_ctrl_c_ends_an_adjustment_after_the_iteration(model):
    started = threading.Event()
    count = []

    def told(record):
        count.append(record)
        started.set()
        time.sleep(0.02)

    interrupt_during(
        lambda: holba.adjust(model, on_iteration=told, max_num_iterations=100000, function_tolerance=0,
                             gradient_tolerance=0, parameter_tolerance=0, gate=False, choose_weights=False),
        started=started,
    )
    assert model.find_inconsistency() is None
    assert len(count) < 5000


def test_ctrl_c_ends_a_command_and_leaves_no_output(scene, tmp_path):
    # Longer than anyone waits: rounds of an accuracy benchmark.
    output = tmp_path / "out"
    started = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    started.start()
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        while True:
            holba.run("adjust", input_path=scene / "perturbed", output_path=output / "x")
    started.join()
    assert time.monotonic() - begin < 60
    assert not [p for p in tmp_path.glob("**/.*holba*")]


def test_other_threads_of_python_run_meanwhile(model):
    ticks = []
    done = threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.monotonic()
    holba.adjust(model)
    end = time.monotonic()
    done.set()
    thread.join()
    assert sum(begin < t < end for t in ticks) >= 5


def test_two_threads_adjust_two_models_to_the_same_bits(model):
    models = [model.copy() for _ in range(3)]
    threads = [threading.Thread(target=holba.adjust, args=(m,), kwargs={"num_threads": 2}) for m in models[:2]]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    holba.adjust(models[2], num_threads=1)
    for m in models[:2]:
        assert_array_equal(m.points3D.xyz(), models[2].points3D.xyz())


def test_messages_go_to_the_logger(model, caplog):
    with caplog.at_level(logging.INFO, logger="holba"):
        holba.adjust(model, max_num_iterations=2)
    assert any("Scales of the Cauchy losses" in r.message for r in caplog.records)
    assert {r.name for r in caplog.records} == {"holba"}


def test_a_part_moves_and_the_rest_keeps_its_bits(model):
    before = model.copy()
    image_ids = list(model.images)[:3]
    selection = holba.select_around(model, image_ids)
    moved = {i for i, held in selection.points if not held}
    assert moved and len(moved) < len(model.points3D)
    summary = holba.adjust_local(model, selection, point_loss="cauchy")
    assert summary.final_cost < summary.initial_cost
    for point_id, point in model.points3D.items():
        if point_id not in moved:
            assert_array_equal(point.xyz, before.points3D[point_id].xyz)
    with pytest.raises(KeyError):
        holba.select_around(model, [999])


def test_what_is_held_keeps_its_bits(model):
    before = model.copy()
    selection = holba.select_all(model)
    frames = list(model.frames)[:2]
    points = list(model.points3D)[:5]
    holba.hold(selection, model, frames=frames, points=points)
    holba.adjust(model, selection=selection, max_num_iterations=5, gate=False, choose_weights=False)
    for frame_id in frames:
        assert model.frames[frame_id].rig_from_world == before.frames[frame_id].rig_from_world
    for point_id in points:
        assert_array_equal(model.points3D[point_id].xyz, before.points3D[point_id].xyz)


def test_covariances_are_symmetric_and_of_the_errors_size(scene, model):
    options = {"refine_focal_length": False, "config": "point_line", "choose_weights": False}
    summary = holba.adjust(model, **options)
    uncertainty = holba.covariances(model, summary, **options)
    assert uncertainty is not None and 0.5 < uncertainty.sigma_px < 2.0
    ids, covariances = uncertainty.points()
    assert covariances.shape == (len(ids), 3, 3)
    assert_allclose(covariances[3], uncertainty.point(int(ids[3])), rtol=1e-12)
    assert_allclose(covariances, covariances.transpose(0, 2, 1), rtol=1e-9, atol=1e-15)
    assert (np.linalg.eigvalsh(covariances) > 0).all()
    with pytest.raises(KeyError):
        uncertainty.point(10**9)


def test_docstrings_tell_of_the_options():
    assert "max_num_iterations: int, at least 0, default 100." in (holba.adjust.__doc__ or "")
    for name in holba.__all__:
        value = getattr(holba, name)
        if callable(value) and not inspect.ismodule(value):
            assert value.__doc__, name
