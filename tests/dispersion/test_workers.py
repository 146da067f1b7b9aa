"""Workers: same bits for any number of them; a case that crashes, hangs or lies costs itself alone; driver and worker
killed in the middle. Minutes in all, so that most of them stand behind `make test-faults`."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from uncertain import RUN, crashing, hanging, lying, raising, slow, stage, toy

from sloshpy.dispersion import campaign as campaign_room
from sloshpy.dispersion import read_campaign, run_campaign
from sloshpy.dispersion.rows import Status, joined
from sloshpy.dispersion.store import Layout
from sloshpy.dispersion.workers import computed
from sloshpy.files import read_dispersion, write_example

LAYOUT = Layout(cases=24, block=6, columns=("a", "b"))


def table(answer, workers, limit=20.0, layout=LAYOUT):
    found = dict(computed(answer, layout, layout.numbers, workers, limit))
    assert sorted(found) == list(layout.numbers)  # each block once
    return joined([found[number] for number in layout.numbers])


def the_others_are_right(rows, status):
    expected = toy(0, 24)
    others = np.arange(24) != 7
    assert rows.status[7] == status
    assert rows.reasons[7] != ""
    assert np.all(rows.status[others] == Status.OK)
    assert np.array_equal(rows.values[others], expected.values[others])


@pytest.mark.parametrize("workers", [0, 2])
def test_a_fault_of_ours_is_that_cases_alone(workers):
    rows = table(raising, workers)
    the_others_are_right(rows, Status.FAILED)
    assert "KeyError" in rows.reasons[7]


def test_a_case_that_kills_its_worker_is_marked_crashed():
    the_others_are_right(table(crashing, 2), Status.CRASHED)


@pytest.mark.faults
def test_a_row_that_is_not_whole_is_not_taken():
    the_others_are_right(table(lying, 2), Status.FAILED)


@pytest.mark.faults
def test_a_case_that_hangs_is_marked_late(monkeypatch):
    monkeypatch.setattr("sloshpy.dispersion.workers.START", 6.0)
    rows = table(hanging, 2, limit=1.0)
    the_others_are_right(rows, Status.TIMEOUT)
    assert "longer than 1 s" in rows.reasons[7]


@pytest.mark.faults
@pytest.mark.parametrize("analysis", [None, RUN])
def test_the_bits_are_the_same_for_any_number_of_workers_and_any_block(analysis, monkeypatch):
    monkeypatch.setattr(campaign_room, "BLOCK", 30)
    whole = run_campaign(stage(analysis), 150, 3)
    for workers in (1, 2, 4):
        assert run_campaign(stage(analysis), 150, 3, workers=workers).digest == whole.digest
    monkeypatch.setattr(campaign_room, "BLOCK", 7)
    assert run_campaign(stage(analysis), 150, 3).digest == whole.digest
    monkeypatch.setattr(campaign_room, "BLOCK", 30)
    backwards = dict(computed(partial(_answer, analysis), _layout(30, whole), range(4, -1, -1), 0, 60.0))
    rows = joined([backwards[k] for k in range(5)])
    assert np.array_equal(rows.values, whole.values, equal_nan=True)


def _answer(analysis, first, count):
    return campaign_room.answered(stage(analysis), 3, first, count)


def _layout(block, campaign):
    return Layout(cases=campaign.count, block=block, columns=tuple(c.name for c in campaign.columns))


@pytest.mark.faults
def test_a_worker_killed_from_outside_loses_nothing():
    rows, killed = {}, []

    def kill_one():
        while not killed:
            time.sleep(0.3)
            children = [p for p in multiprocessing.active_children() if p.is_alive()]
            if rows and children:
                children[0].kill()
                killed.append(children[0].pid)

    threading.Thread(target=kill_one, daemon=True).start()
    layout = Layout(cases=120, block=20, columns=("a", "b"))
    for number, part in computed(slow, layout, layout.numbers, 2, 20.0):
        rows[number] = part
    assert killed
    whole = joined([rows[number] for number in layout.numbers])
    assert np.array_equal(whole.values, toy(0, 120).values)  # killed once, no case is to blame
    assert np.all(whole.status == Status.OK)


@pytest.mark.faults
def test_a_driver_that_is_killed_or_interrupted_is_resumed_to_the_same_hash(tmp_path):
    write_example("upper_stage", tmp_path)
    file = write_example("upper_stage_dispersed", tmp_path)
    text = file.read_text().replace('input = "autopilot.delay"', 'input = "autopilot.rate_gain"')
    file.write_text(text.replace('"0 s"', '"0.13 s"').replace('"20 ms"', '"0.15 s"'))
    program = Path(sys.executable).with_name("sloshpy")

    def command(*more):
        words = [program, "disperse", file, "--cases", "5000", "--seed", "4", "--store", tmp_path / "s", *more]
        return [str(word) for word in words]

    for how in (signal.SIGKILL, signal.SIGINT, signal.SIGKILL):
        resumed = ["--resume"] if (tmp_path / "s").exists() else []
        blocks = len(list(tmp_path.glob("s/block-*.bin")))
        with subprocess.Popen(command(*resumed), stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as driver:
            deadline = time.monotonic() + 60.0
            while len(list(tmp_path.glob("s/block-*.bin"))) <= blocks and time.monotonic() < deadline:
                time.sleep(0.02)
            os.kill(driver.pid, how)
            said = driver.communicate(timeout=60)[1]
            assert driver.returncode in {-how, 130, 0, 1}
            if driver.returncode == 130:
                assert "what is finished is kept" in said
    ended = subprocess.run(command("--resume"), capture_output=True, text=True, timeout=200)
    assert ended.returncode in {0, 1}, ended.stderr
    stored = read_campaign(read_dispersion(file), tmp_path / "s")
    assert stored.digest == run_campaign(read_dispersion(file), 5000, 4).digest
    assert sorted(p.name for p in (tmp_path / "s").iterdir() if "tmp" in p.name or p.name == "lock") == []
