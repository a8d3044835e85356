"""What becomes of workers when the process that started them is killed or interrupted."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from gasp_core import Recording
from gasp_core.io import write_splat
from gasp_core.toy import make_toy

FAKES = Path(__file__).parents[1] / "fake_plugins"
SUPPORT = Path(__file__).parents[1] / "support"
PATIENCE = 60.0

SCENE = """\
[scene]
duration = 40
frame_rate = 25
[[object]]
name = "toy"
splat = "toy.ply"
up = "+z"
material = { model = "elastic", density = 200, youngs_modulus = 3e4, poissons_ratio = 0.3 }
[engine]
name = "frail"
isolate = true
[engine.options]
note = "note"
"""

# Opens a session, in the main thread or in another one, says who its worker is, and hangs in it.
PARENT = """
import sys, threading
import numpy as np
from gasp_core import Elastic, EngineAccuracy, Precision
from gasp_core.contract import PointCloud, PointProblem
from gasp_core.engines.opening import open_worker
from gasp_core.discovery.registry import discover
from fake_frail import FrailOptions

points = PointCloud(
    reference_positions=np.zeros((9, 3)), initial_velocities=np.zeros((9, 3)), reference_volumes=np.ones(9),
    material_ids=np.zeros(9), body_ids=np.zeros(9),
)
problem = PointProblem(points=points, materials=(Elastic(density=1e3, youngs_modulus=1e5, poissons_ratio=0.3),))

def work():
    with open_worker(discover().offer("frail")).open(
        problem, device="cpu", precision=Precision.FLOAT64, seed=0, accuracy=EngineAccuracy(),
        options=FrailOptions(fault=sys.argv[2], fault_time=0.1),
    ) as session:
        print(session._worker.pid, flush=True)
        session.advance_to(0.1)
        input()

if sys.argv[1] == "main":
    work()
else:
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
"""


def surroundings():
    path = [str(FAKES / "frail"), str(SUPPORT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(path)}


@pytest.mark.parametrize(
    ("thread", "fault"),
    [
        ("other", "hang in C"),
        *(
            pytest.param(thread, fault, marks=pytest.mark.thorough)
            for thread, fault in [
                ("main", "hang in C"),
                ("main", "hang"),
                ("other", "hang"),
                ("main", ""),
                ("other", ""),
            ]
        ),
    ],
)
def test_a_worker_does_not_outlive_its_parent(thread, fault, gone):
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, thread, fault],
        env=surroundings(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with parent:
        pid = int(parent.stdout.readline())
        time.sleep(0.3)  # into the frame
        assert psutil.pid_exists(pid)
        parent.kill()
        parent.wait()
        assert gone(pid)


@pytest.fixture
def run(tmp_path):
    """A `gasp run` that a terminal would have started, and the pid of its worker once it has one."""
    write_splat(tmp_path / "toy.ply", make_toy(64))
    started = []

    def start(fault="", fault_time=0.1):
        scene = SCENE + f'fault = "{fault}"\nfault_time = {fault_time}\n'
        (tmp_path / "scene.toml").write_text(scene)
        process = subprocess.Popen(
            [sys.executable, "-m", "gasp_core.cli.main", "run", "scene.toml", "--json"],
            cwd=tmp_path,
            env=surroundings(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()


def wait_for(found):
    deadline = time.monotonic() + PATIENCE
    while not found():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def workers_of(process):
    return [child.pid for child in psutil.Process(process.pid).children(recursive=True)]


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_ctrl_c_and_sigterm_stop_at_the_frame_and_the_worker_is_not_hit(run, tmp_path, gone, logs, number, status):
    process = run()
    wait_for(lambda: (tmp_path / "scene.gasp/commits/00000003").exists())
    workers = workers_of(process)
    if number == signal.SIGTERM:
        # As Slurm does, to all processes of a step, whatever session they are of.
        for worker in workers:
            os.kill(worker, number)
    os.killpg(process.pid, number)
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == status, err
    assert "to go on: gasp run scene.toml --resume" in err
    told = json.loads(out)
    assert told["status"] == "incomplete"
    assert "interrupted after frame" in told["reason"]
    assert workers
    assert gone(*workers)
    assert Recording.open(tmp_path / "scene.gasp").frame_count == told["frame_count"] >= 4
    assert logs() == []


@pytest.mark.thorough
def test_ctrl_c_twice_ends_a_hanging_worker(run, tmp_path, gone, logs):
    process = run(fault="hang", fault_time=0.16)
    wait_for(lambda: any("about to hang" in log.read_text() for log in logs() if log.is_file()))
    workers = workers_of(process)
    assert workers
    os.killpg(process.pid, signal.SIGINT)
    time.sleep(0.5)
    assert process.poll() is None
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=5.0)  # a limit of hanging
    assert process.returncode == 130
    assert "the frames so far are kept, to go on: gasp run scene.toml --resume" in err
    assert gone(*workers)
    assert Recording.open(tmp_path / "scene.gasp").frame_count == 4
    assert logs() == []


def test_a_killed_worker_is_one_line_and_status_2(run, tmp_path, logs):
    process = run(fault="hang", fault_time=0.16)
    wait_for(lambda: any("about to hang" in log.read_text() for log in logs() if log.is_file()))
    (worker,) = [child.pid for child in psutil.Process(process.pid).children()]
    os.kill(worker, signal.SIGKILL)
    _, err = process.communicate(timeout=5.0)  # a limit of hanging
    assert process.returncode == 2
    assert err.startswith('gasp: engine "frail" was killed by SIGKILL')
    assert err.count("\n") == 1
    assert "the frames so far are kept in scene.gasp" in err
    assert Recording.open(tmp_path / "scene.gasp").frame_count == 4


@pytest.mark.thorough
def test_the_next_run_removes_the_log_that_a_killed_one_left(run, logs, gone, tmp_path):
    killed = run("hang")
    wait_for(lambda: workers_of(killed) and logs())
    worker = workers_of(killed)[0]
    killed.kill()
    killed.wait()
    assert gone(worker)
    assert len(logs()) == 1
    again = run()
    again.communicate()
    assert list((tmp_path / "logs").glob("gasp-*")) == []
