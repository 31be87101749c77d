"""Who hears MuJoCo's warnings, and that no file is written of them."""

from __future__ import annotations

import logging
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import mujoco
import pytest

from garden_models.physics.mujoco_warnings import Collected, collect_warnings

BALL = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"


def explode(speed=1e30):
    """Step a body so fast that MuJoCo warns of its velocity."""
    model = mujoco.MjModel.from_xml_string(BALL)
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    mujoco.mj_step(model, data)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_warning_is_collected_and_not_written(folder):
    with collect_warnings() as warned:
        explode()
    (reason,) = warned.reasons
    assert reason.startswith("MuJoCo warned once: ")
    assert "unstable" in reason
    assert list(folder.iterdir()) == []


def test_left_alone_mujoco_writes_a_file(folder):
    """What all this is for: should it cease, the collector has nothing to keep away."""
    with collect_warnings():
        pass
    explode()
    assert [file.name for file in folder.iterdir()] == ["MUJOCO_LOG.TXT"]


def test_warnings_that_differ_in_numbers_only_are_counted():
    collected = Collected()
    collected.add("Too many contacts. (ncon = 12) Time = 0.1000.")
    collected.add("Nan in QVEL at DOF 0. The simulation is unstable. Time = 0.2000.")
    collected.add("Too many contacts. (ncon = 34) Time = 0.3000.")
    assert collected.reasons == (
        "MuJoCo warned 2 times: Too many contacts. (ncon = 12)",
        "MuJoCo warned once: Nan in QVEL at DOF 0. The simulation is unstable.",
    )


def test_nothing_to_warn_of_is_no_reason():
    with collect_warnings() as warned:
        explode(speed=0.0)
    assert warned.reasons == ()


def test_an_outer_collector_hears_what_an_inner_one_does():
    with collect_warnings() as outer:
        with collect_warnings() as inner:
            explode()
        assert inner.reasons == outer.reasons != ()


@pytest.fixture
def heard():
    """What the handler hears that the caller had installed."""
    warnings = []
    mujoco.set_mju_user_warning(warnings.append)
    yield warnings
    mujoco.set_mju_user_warning(None)


def test_the_callers_handler_is_back_afterwards_even_after_an_error(heard):
    with pytest.raises(ZeroDivisionError), collect_warnings():
        explode()
        _ = 1 / 0
    assert heard == []
    explode()
    assert len(heard) == 1


def test_the_callers_handler_hears_what_nobody_collects_on_a_thread(heard):
    with collect_warnings() as warned, ThreadPoolExecutor(1) as pool:
        pool.submit(explode).result()
    assert len(heard) == 1
    assert warned.reasons == ()


def test_threads_hear_their_own_warnings_only(folder):
    together = Barrier(2, timeout=10)

    def run(speed):
        with collect_warnings() as warned:
            together.wait()
            explode(speed)
            together.wait()
        return warned.reasons

    with ThreadPoolExecutor(2) as pool:
        loud, quiet = pool.map(run, [1e30, 0.0])
    assert len(loud) == 1
    assert quiet == ()
    assert list(folder.iterdir()) == []


def test_without_a_callers_handler_that_goes_to_the_log(folder, caplog):
    with (
        caplog.at_level(logging.WARNING, "mujoco"),
        collect_warnings() as warned,
        ThreadPoolExecutor(1) as pool,
    ):
        pool.submit(explode).result()
    assert "unstable" in caplog.text
    assert warned.reasons == ()
    assert list(folder.iterdir()) == []
