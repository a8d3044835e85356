"""Runs by the workers of Dask and of Ray, some of which are lost."""

import _thread
import contextlib
import os
import signal
import threading
import time
from collections import Counter
from dataclasses import replace

import psutil
import pytest

from gasp_core import simulate
from gasp_core.errors import BackendError
from gasp_core.io.detect import INDICES
from gasp_core.scene.files import files_of
from gasp_core.studies.runs import Limits, Run, chosen_backend
from gasp_core.studies.runs.backends.parcels import Missing, begun_now, carry_out_parcel, packed, parcels_of
from gasp_core.studies.sweep import Measures, planned, settings_of, sweep

RUNS = 10


def settings():
    spins = ",".join(map(str, range(1, RUNS + 1)))
    return settings_of(["engine.options.pause=0.05", f"engine.options.spin={spins}"])


def tips(plan, folder):
    """What the same runs come to in this process, one after the other."""
    found = []
    for each in plan:
        here = simulate(each.scene, out=folder / "here.gasp", overwrite=True, progress=False)
        found.append(here.points(here.frame_count - 1)[:, 2].max())
    return found


def at_it():
    """The processes of runs of this test; whoever started them, by what they were told of its cache."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            own = "gasp_core.studies.runs.child" in process.cmdline() and process.status() != psutil.STATUS_ZOMBIE
            if own and process.environ().get("GASP_CACHE") == os.environ["GASP_CACHE"]:
                found.append(process)
    return found


@contextlib.contextmanager
def killed_in_the_middle(told):
    """Kill the process of one worker once some runs are done; how many were done by then."""
    killed = []

    def kill():
        while not killed and time.monotonic() < deadline:
            time.sleep(0.02)
            runs = at_it() if len(told()) >= 3 else []
            with contextlib.suppress(psutil.Error):
                if runs and (worker := runs[0].parent()) is not None:
                    worker.send_signal(signal.SIGKILL)
                    killed.append(len(told()))

    deadline = time.monotonic() + 120
    thread = threading.Thread(target=kill)
    thread.start()
    try:
        yield killed
    finally:
        deadline = 0.0
        thread.join()


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["dask", "ray"])
def test_a_worker_that_is_killed_has_its_run_made_again_and_only_that(scene, tmp_path, measured, name):
    pytest.importorskip("distributed" if name == "dask" else "ray")
    observable, told = measured
    plan = planned(scene, settings())
    with killed_in_the_middle(told) as killed:
        found = sweep(
            plan,
            tmp_path / "out",
            measures=Measures(observables=(observable,)),
            backend=chosen_backend(name, at_once=3),
            limits=Limits(threads=1),
            progress=False,
        )
    assert killed and killed[0] < RUNS, "no worker was killed in the middle"
    assert [row.status for row in found.rows] == ["complete"] * RUNS
    assert [row.columns["tip"] for row in found.rows] == tips(plan, tmp_path)
    # Measured once each: at most the one whose worker was killed when it had measured it, and not yet told, twice.
    counts = Counter(told())
    assert set(counts) == {str(spin) for spin in range(1, RUNS + 1)}
    assert sum(counts.values()) <= RUNS + 1


@pytest.mark.thorough
def test_a_scheduler_that_is_there(scene, tmp_path):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, distributed.Client(cluster) as client:
        client.write_scheduler_file(str(tmp_path / "scheduler.json"))
        for where in (cluster.scheduler_address, str(tmp_path / "scheduler.json")):
            plan = planned(scene, settings_of(["engine.options.spin=1,2,-1", "object.toy.height=0.3,-1"]))
            backend = chosen_backend("dask", scheduler=where)
            found = sweep(plan, tmp_path / "out", backend=backend, overwrite=True, progress=False)
            assert [row.status for row in found.rows] == ["complete", "refused"] * 3
        # The cluster is not ours to close.
        assert client.submit(sum, [1, 2]).result() == 3


def test_schedulers_that_are_not_there(scene, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    from gasp_core.studies.runs.backends import dask_cluster

    monkeypatch.setattr(dask_cluster, "_PATIENCE", 0.5)
    plan = planned(scene, settings_of(["engine.options.spin=1"]))
    for where, said in (
        ("tcp://127.0.0.1:9", "no dask scheduler at tcp://127.0.0.1:9"),
        ("nowhere.json", "is neither a scheduler file nor an address"),
    ):
        with pytest.raises(BackendError, match=said) as caught:
            sweep(plan, tmp_path / "out", backend=chosen_backend("dask", scheduler=where), progress=False)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("127.0.0.1:9", "no ray cluster at 127.0.0.1:9"),
        ("ray://127.0.0.1:9", "no ray cluster at ray://127.0.0.1:9"),
        ("127.0.0.1:99999", "no ray cluster at 127.0.0.1:99999"),
        ("head", "is no address of ray"),
    ],
)
def test_ray_clusters_that_are_not_there(scene, tmp_path, where, said):
    """Told at once, and not after Ray's own quarter of an hour."""
    pytest.importorskip("ray")
    plan = planned(scene, settings_of(["engine.options.spin=1"]))
    with pytest.raises(BackendError, match=said) as caught:
        sweep(plan, tmp_path / "out", backend=chosen_backend("ray", scheduler=where), progress=False)
    assert "\n" not in str(caught.value)


@pytest.mark.thorough
def test_what_is_left_early_is_ended_on_its_worker(scene, tmp_path):
    """As Ctrl-C does it."""
    distributed = pytest.importorskip("distributed")
    (each,) = planned(scene, settings_of(["engine.options.fault=hang"]))
    out = tmp_path / "run.gasp"

    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        backend = chosen_backend("dask", scheduler=cluster.scheduler_address)
        runs, begun = [Run(key="a", scene=each.scene, out=out)], []

        def interrupt():
            deadline = time.monotonic() + 60
            while not at_it() and time.monotonic() < deadline:
                time.sleep(0.05)
            begun.extend(at_it())
            _thread.interrupt_main()

        threading.Thread(target=interrupt, daemon=True).start()
        with pytest.raises(KeyboardInterrupt), backend.made(runs, Limits()) as results:
            list(results)
        assert begun
        deadline = time.monotonic() + 20
        while at_it() and time.monotonic() < deadline:
            time.sleep(0.05)
        assert at_it() == []


# --- what travels ---------------------------------------------------------------------------------------------------


@pytest.fixture
def parcel(scene, tmp_path):
    (each,) = planned(scene, settings_of(["engine.options.spin=1"]))
    run = Run(key="a", scene=each.scene, out=tmp_path / "out.gasp", measure=Measures(), keep=False)
    (found,) = parcels_of([run], Limits())
    return found


def test_a_file_that_a_worker_sees_is_read_there(parcel):
    assert carry_out_parcel(parcel, {}, lambda: True).found["points"] > 0


@pytest.mark.parametrize("gone", ["removed", "changed"])
def test_a_file_that_a_worker_does_not_see_is_asked_for_once(parcel, scene, tmp_path, gone):
    (source,) = parcel.sources
    content = packed(source.path)
    path = scene.parent / "toy.ply"
    if gone == "removed":
        path.unlink()
    else:
        path.write_bytes(b"another")
    assert carry_out_parcel(parcel, {}, lambda: True) == Missing((source.digest,))
    first = carry_out_parcel(parcel, {source.digest: content}, lambda: True)
    # It lies in the cache of the machine now.
    again = carry_out_parcel(parcel, {}, lambda: True)
    assert first.found == again.found and first.found["points"] > 0
    assert (tmp_path / "cache" / "sources" / source.digest / "toy.ply").is_file()


def test_what_a_lost_worker_has_left_is_in_nobodys_way(parcel, scene, tmp_path):
    """Of a run whose recording is kept; what was there before is not touched."""
    import dataclasses

    from gasp_core import load_scene

    kept = dataclasses.replace(parcel.run, keep=True)
    (fresh,) = begun_now(parcels_of([kept], Limits()))
    simulate(load_scene(scene), out=kept.out, frames=2, progress=False)
    assert carry_out_parcel(fresh, {}, lambda: True).frame_count == 5
    (stale,) = begun_now(parcels_of([kept], Limits()))
    assert "is there already" in carry_out_parcel(stale, {}, lambda: True).reason


def test_nothing_of_others_is_removed_from_the_cache(parcel, scene, tmp_path):
    """Though it is old; and what travels may be older than .zip knows."""
    others = tmp_path / "cache" / "sources" / "mine"
    others.mkdir(parents=True)
    for path in (others, scene.parent / "toy.ply"):
        os.utime(path, (1.0, 1.0))
    (source,) = parcels_of([parcel.run], Limits())[0].sources
    content = packed(source.path)
    (scene.parent / "toy.ply").unlink()
    assert carry_out_parcel(parcel, {source.digest: content}, lambda: True).frame_count == 5
    assert others.is_dir()


def test_a_folder_travels_as_a_whole(tmp_path, scene):
    """The frames of a dynamic splat, and what is named by an index in its folder."""
    frames = tmp_path / "frames"
    (frames / "deep").mkdir(parents=True)
    (frames / "deep" / "a.bin").write_bytes(b"a")
    (frames / INDICES[0]).write_bytes(b"{}")
    (each,) = planned(scene, settings_of(["engine.options.spin=1"]))
    for named in (frames, frames / INDICES[0]):
        from gasp_core.scene.files import with_files

        run = Run(key="a", scene=with_files(each.scene, lambda path, named=named: named), out=tmp_path / "out.gasp")
        (parcel,) = parcels_of([run], Limits())
        (source,) = parcel.sources
        assert (source.path, source.folder) == (frames, True)
        content = packed(frames)
        (frames / "deep" / "a.bin").write_bytes(b"other")
        outcome = carry_out_parcel(parcel, {source.digest: content}, lambda: True)
        assert "frames" in outcome.reason, "it is read, and is no splat"
        kept = tmp_path / "cache" / "sources" / source.digest / "frames"
        assert (kept / "deep" / "a.bin").read_bytes() == b"a"
        (frames / "deep" / "a.bin").write_bytes(b"a")


def test_python_beside_a_scene_travels_with_it(scene, tmp_path):
    """A worker that sees nothing of it has a copy, and runs that where the scene is trusted."""
    code = scene.parent / "lifts.py"
    code.write_text("def up(simplices, time):\n    return simplices + [0, 0, 0.5 * time]\n")
    motion = '[object.motion]\nkind = "python"\nfunction = "lifts:up"\n'
    text = scene.read_text().replace("[engine]", f"{motion}\n[engine]")
    scene.write_text(text)
    (each,) = planned(scene, settings_of(["engine.options.spin=1"]))
    run = Run(key="a", scene=each.scene, out=tmp_path / "out.gasp", measure=Measures(), keep=False, trust_code=True)
    here = carry_out_parcel(parcels_of([run], Limits())[0], {}, lambda: True)
    (parcel,) = parcels_of([run], Limits())
    assert {source.path.name for source in parcel.sources} == {"toy.ply", "lifts.py"}
    contents = {source.digest: packed(source.path) for source in parcel.sources}
    code.unlink()
    (scene.parent / "toy.ply").unlink()
    assert isinstance(carry_out_parcel(parcel, {}, lambda: True), Missing)
    assert carry_out_parcel(parcel, contents, lambda: True).found == here.found
    assert (
        "--trust-code" in carry_out_parcel(replace(parcel, run=replace(run, trust_code=False)), {}, lambda: True).reason
    )


def test_files_of_a_scene_are_each_named_once(scene):
    from gasp_core import load_scene

    text = scene.read_text()
    text += '\n[[object]]\nname = "other"\nsplat = "toy.ply"\nstatic = true\n'
    text += '[[collider]]\nshape = "mesh"\nmesh = "floor.obj"\ncontact = "stick"\n[camera]\nfile = "view.json"\n'
    scene.write_text(text)
    for name in ("floor.obj", "view.json"):
        (scene.parent / name).write_text("")
    assert [path.name for path in files_of(load_scene(scene))] == ["floor.obj", "view.json", "toy.ply"]


@pytest.fixture
def unseen(scene, monkeypatch):
    """The splat is there for the one that asks for runs, and for no worker: how often it was read, to be sent."""
    from gasp_core.studies.runs.backends import dask_cluster
    from gasp_core.studies.runs.backends import parcels as parcels_module

    hidden = scene.parent / "toy.ply"
    parcels, content, asked = dask_cluster.parcels_of, hidden.read_bytes(), []

    def parcels_then_hide(runs, limits):
        found = parcels(runs, limits)
        hidden.unlink()
        return found

    def read_again(path):
        asked.append(path)
        hidden.write_bytes(content)
        found = packed(path)
        hidden.unlink()
        return found

    monkeypatch.setattr(dask_cluster, "parcels_of", parcels_then_hide)
    monkeypatch.setattr(parcels_module, "packed", read_again)
    return asked


@pytest.mark.thorough
def test_dask_sends_what_is_missing_once_to_each_worker(scene, tmp_path, unseen):
    """Workers that see no file: as on other machines. The first runs ask for it, and the others find it."""
    pytest.importorskip("distributed")
    plan = planned(scene, settings_of(["engine.options.spin=1,2,3,4,5,6"]))
    found = sweep(plan, tmp_path / "out", backend=chosen_backend("dask", at_once=2), progress=False)
    assert [row.status for row in found.rows] == ["complete"] * 6
    assert unseen == [scene.parent / "toy.ply"]


@pytest.mark.thorough
def test_the_worker_that_holds_what_was_sent_is_lost(scene, tmp_path, unseen):
    """Dask keeps one copy of it where one worker waits for it, and with that copy forgets the runs that wait."""
    distributed = pytest.importorskip("distributed")
    plan = planned(scene, settings_of(["engine.options.pause=0.05", "engine.options.spin=1,2,3"]))
    killed = []

    def kill(cluster):
        while not killed and time.monotonic() < deadline:
            time.sleep(0.02)
            held = [str(task.key) for worker in cluster.scheduler.workers.values() for task in list(worker.has_what)]
            if any(key.startswith("bytes-") for key in held) and at_it():
                os.kill(cluster.workers[0].process.pid, signal.SIGKILL)
                killed.append(held)

    deadline = time.monotonic() + 120
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        thread = threading.Thread(target=kill, args=(cluster,))
        thread.start()
        backend = chosen_backend("dask", scheduler=cluster.scheduler_address)
        found = sweep(plan, tmp_path / "out", backend=backend, progress=False)
        deadline = 0.0
        thread.join()
    assert killed, "no worker was killed while a run waited"
    assert [row.status for row in found.rows] == ["complete"] * 3


@pytest.mark.thorough
def test_a_scheduler_that_goes(scene, tmp_path, measured):
    """One line, and not one for each run; what was done is kept."""
    distributed = pytest.importorskip("distributed")
    observable, told = measured
    plan, out = planned(scene, settings()), tmp_path / "out"
    measures = Measures(observables=(observable,))
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        backend = chosen_backend("dask", scheduler=cluster.scheduler_address)

        def close():
            while len(told()) < 2:
                time.sleep(0.02)
            cluster.close()

        thread = threading.Thread(target=close)
        thread.start()
        with pytest.raises(BackendError, match=r"the connection to the dask scheduler .* is lost") as caught:
            sweep(plan, out, measures=measures, backend=backend, progress=False)
        thread.join()
    assert "\n" not in str(caught.value)
    done = len((out / "sweep.jsonl").read_text().splitlines())
    found = sweep(plan, out, measures=measures, backend=chosen_backend(at_once=2), progress=False)
    assert [row.status for row in found.rows] == ["complete"] * RUNS
    assert 1 <= found.kept <= done


@pytest.mark.thorough
def test_a_scheduler_whose_workers_come_later(scene, tmp_path, caplog):
    """As those of a queue do, or of a cluster that grows with its tasks."""
    distributed = pytest.importorskip("distributed")
    plan = planned(scene, settings_of(["engine.options.spin=1,2"]))
    with distributed.LocalCluster(n_workers=0, threads_per_worker=1, dashboard_address=None) as cluster:
        cluster.adapt(minimum=0, maximum=2, interval="200ms")
        backend = chosen_backend("dask", scheduler=cluster.scheduler_address)
        found = sweep(plan, tmp_path / "out", backend=backend, progress=False)
    assert [row.status for row in found.rows] == ["complete"] * 2
    assert "has no worker yet" in caplog.text
