"""Recordings at addresses: in memory, and on an object store whose connection is lost."""

from __future__ import annotations

import asyncio
import contextlib
import json
import types
from pathlib import Path

import flying_points
import numpy as np
import pytest
from object_store import GoogleStore, object_store
from ssh_host import ssh_host

from gasp_core import Recording, RecordingChoice, simulate
from gasp_core.errors import RecordingError
from gasp_core.recording.addresses import Mirror, address_of, local_copy
from gasp_core.recording.verifying import verify

fsspec = pytest.importorskip("fsspec")


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """This machine's; `elsewhere` is another machine's."""
    monkeypatch.setenv("GASP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("gasp_core.recording.addresses._PAUSE", 0.0)


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """From here on on a machine that has seen nothing."""
    count = iter(range(100))
    return lambda: monkeypatch.setenv("GASP_CACHE", str(tmp_path / f"machine {next(count)}"))


@pytest.fixture
def store():
    """A file system in memory, empty."""
    files = fsspec.filesystem("memory")
    files.store.clear()
    files.pseudo_dirs[:] = [""]
    return files


@pytest.fixture(scope="module")
def bucket():
    with object_store() as address:
        yield address


@pytest.fixture(scope="module")
def google_bucket():
    with GoogleStore().open() as address:
        yield address


@pytest.fixture
def record(scene_of, cloud):
    def go(out, *, frames=None, duration=0.16, engine=None, **others):
        scene = scene_of(cloud(20), duration=duration, recording=RecordingChoice(checkpoint_frames=2))
        engine = engine or (flying_points.descriptor(), flying_points.Ballistic())
        return simulate(scene, engine, out, frames=frames, progress=False, **others)

    return go


def same(one, other):
    assert one.frame_count == other.frame_count and one.status == other.status
    for frame in range(one.frame_count):
        assert np.array_equal(one.points(frame), other.points(frame))
    assert verify(one.path).damaged == ()


@pytest.mark.parametrize(
    ("path", "address"),
    [
        ("s3://b/run.gasp", "s3://b/run.gasp"),
        ("s3:/b/run.gasp", "s3://b/run.gasp"),
        ("memory://run.gasp/", "memory://run.gasp"),
        ("ssh://host/a/run.gasp", "ssh://host/a/run.gasp"),
        ("/a/run.gasp", None),
        ("C:/a/run.gasp", None),
        ("file:///a/run.gasp", None),
        ("run.gasp", None),
        ("a:b", None),
    ],
)
def test_what_is_an_address(path, address):
    assert address_of(path) == address


@pytest.mark.parametrize("head", ["file://", "local://", "file:"])
def test_a_path_may_be_written_as_an_address(record, tmp_path, monkeypatch, head):
    monkeypatch.chdir(tmp_path)
    place = f"{head}{tmp_path}/there/run.gasp"
    for name in (place, Path(place)):
        assert record(name, frames=1, overwrite=True).path == tmp_path / "there" / "run.gasp"
        assert Recording.open(name).frame_count == 1
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


@pytest.fixture
def roots(request, store):
    """roots(where) -> the address of a place to put recordings into."""

    def find(where):
        if where == "ssh":
            return f"{request.getfixturevalue('host').address}/runs"
        if where == "memory":
            return "memory://runs"
        return request.getfixturevalue({"s3": "bucket", "gs": "google_bucket"}[where])

    return find


@pytest.fixture
def host(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("SSH_AUTH_SOCK", raising=False)
    (tmp_path / "host").mkdir()
    with ssh_host(tmp_path / "host", tmp_path / "home") as found:
        yield found


@pytest.mark.parametrize("where", ["memory", "s3", "gs", "ssh"])
def test_a_run_at_an_address_is_that_on_disk(record, tmp_path, elsewhere, roots, where):
    root = roots(where)
    disk = record(tmp_path / "disk.gasp")
    made = record(f"{root}/whole.gasp")
    same(made, disk)
    elsewhere()
    found = Recording.open(f"{root}/whole.gasp")
    assert found.path != made.path
    same(found, disk)


@pytest.mark.parametrize("where", ["s3", "gs"])
def test_a_bucket_that_is_not_there_is_named(record, roots, where):
    roots(where)
    with pytest.raises(
        RecordingError, match=rf'^{where}://none/a\.gasp: cannot be written: there is no bucket "none"$'
    ):
        record(f"{where}://none/a.gasp")


@pytest.fixture
def hasty(monkeypatch):
    """Google's file system waits for half a minute between what it tries: here for nothing."""
    retry = pytest.importorskip("gcsfs.retry")
    at_once = types.SimpleNamespace(**{**vars(asyncio), "sleep": lambda seconds: asyncio.sleep(0)})
    monkeypatch.setattr(retry, "asyncio", at_once)


def test_a_store_that_is_gone_in_the_middle(record, hasty, capfd):
    """Said in a line; what its library logs besides is nothing to those who have not asked."""
    store = GoogleStore()
    with store.open() as root:
        told = r"gs://runs/a\.gasp: is not complete, the connection was lost \(Cannot connect to host"
        with pytest.raises(RecordingError, match=told):
            record(f"{root}/a.gasp", recorded=lambda frame: store.break_down() if frame == 2 else None)
        with pytest.raises(RecordingError, match=r"gs://runs/a\.gasp: cannot be read: Cannot connect to host"):
            Recording.open(f"{root}/a.gasp")
    assert capfd.readouterr() == ("", "")


def test_where_there_are_folders_they_are_made(record, tmp_path, elsewhere):
    """As on another machine, by ssh: here one of this machine's folders."""
    from fsspec.implementations.local import LocalFileSystem

    class Foldered(LocalFileSystem):
        protocol = "foldered"

        def __init__(self, **others):
            super().__init__(auto_mkdir=False, **others)

        @classmethod
        def _strip_protocol(cls, path):
            return str(path).removeprefix("foldered:/")

    fsspec.register_implementation("foldered", Foldered, clobber=True)
    address = f"foldered:/{tmp_path}/far/away.gasp"
    disk = record(tmp_path / "disk.gasp")
    record(address, frames=2)
    same(Recording.open(tmp_path / "far" / "away.gasp"), record(tmp_path / "two.gasp", frames=2))
    elsewhere()
    same(record(address, resume=True), disk)


def test_frames_are_there_as_they_come(record, store, elsewhere):
    """Read by somebody else while the run goes on."""
    seen = []

    def look(frame):
        keys = sorted(store.find("/runs/a.gasp"))
        commits = [key for key in keys if "/commits/0" in key]
        displacements = [key for key in keys if "/frames/displacements/c" in key]
        seen.append((len(commits), len(displacements)))

    record("memory://runs/a.gasp", recorded=look)
    assert [commits for commits, _ in seen] == [1, 2, 3, 4, 5]
    assert all(displacements >= commits for commits, displacements in seen)


@pytest.mark.parametrize("where", ["memory", "s3", "gs", "ssh"])
def test_going_on_elsewhere_is_the_run_that_never_stopped(record, tmp_path, elsewhere, roots, where):
    address = f"{roots(where)}/on.gasp"
    disk = record(tmp_path / "disk.gasp")
    record(address, frames=3)
    elsewhere()
    same(record(address, resume=True), disk)
    elsewhere()
    same(Recording.open(address), disk)
    # There is nothing of what was there before and is no more.
    files, root = fsspec.core.url_to_fs(address)
    files.invalidate_cache()
    found = [key.partition("/on.gasp/checkpoints/")[2] for key in files.find(f"{root}/checkpoints")]
    assert 1 <= len({key.split("/")[0] for key in found if "/" in key}) <= 2


def test_a_host_that_hangs_up_is_called_again(record, tmp_path, elsewhere, host):
    """Whoever keeps a connection has a dead one from then on."""
    disk = record(tmp_path / "disk.gasp")
    cut = []

    def recorded(frame):
        if frame in (1, 2):
            cut.append(host.hang_up())

    same(record(f"{host.address}/runs/a.gasp", recorded=recorded), disk)
    assert min(cut) > 0
    elsewhere()
    host.hang_up()
    same(Recording.open(f"{host.address}/runs/a.gasp"), disk)


def test_a_host_that_does_not_know_one_says_so(record, host):
    stranger = host.address.replace("me@", "you@")
    with pytest.raises(RecordingError, match=r"cannot be opened: .*[Aa]uthentication"):
        record(f"{stranger}/runs/a.gasp")


@pytest.mark.parametrize("known", ["", "another key"])
def test_a_host_that_one_does_not_know_is_not_talked_to(record, host, tmp_path, known):
    keys = tmp_path / "home" / ".ssh" / "known_hosts"
    asyncssh = pytest.importorskip("asyncssh")
    other = asyncssh.generate_private_key("ssh-ed25519").export_public_key().decode()
    keys.write_text(f"{keys.read_text().split()[0]} {other}" if known else "")
    with pytest.raises(RecordingError, match=r"cannot be opened: .*(not found in known_hosts|does not match)"):
        record(f"{host.address}/runs/a.gasp")


def test_a_host_has_the_name_that_ssh_has_for_it(record, tmp_path, host):
    """As in ~/.ssh/config: a name, a port, a user and a key of its own."""
    keys, port = tmp_path / "home" / ".ssh", host.address.rpartition(":")[2]
    (keys / "id_ed25519").rename(keys / "own")
    (keys / "config").write_text(
        f"Host cluster\n  HostName 127.0.0.1\n  Port {port}\n  User me\n  IdentityFile {keys}/own\n"
    )
    same(record("ssh://cluster/runs/a.gasp"), record(tmp_path / "disk.gasp"))


@pytest.mark.parametrize("said", ["named", "plainly", "for all"])
def test_a_host_behind_another_is_reached_through_it(record, tmp_path, host, said):
    """As in ~/.ssh/config: by name, by all that it takes, and by a pattern that the host on the way fits too."""
    keys, port = tmp_path / "home" / ".ssh", host.address.rpartition(":")[2]
    gone_to = []
    (tmp_path / "door").mkdir()
    with ssh_host(tmp_path / "door", tmp_path / "home", jumps=gone_to) as door:
        at = door.address.rpartition(":")[2]
        jump = f"me@127.0.0.1:{at}" if said == "plainly" else "door"
        behind = "*" if said == "for all" else "cluster"
        (keys / "config").write_text(
            f"Host door\n  Port {at}\nHost cluster\n  Port {port}\n"
            f"Host {behind}\n  ProxyJump {jump}\nHost *\n  HostName 127.0.0.1\n  User me\n"
        )
        same(record("ssh://cluster/runs/a.gasp"), record(tmp_path / "disk.gasp"))
    assert set(gone_to) == {int(port)} and (tmp_path / "host" / "runs" / "a.gasp").is_dir()


def test_a_host_that_lets_nobody_through_says_so(record, tmp_path, host):
    keys = tmp_path / "home" / ".ssh"
    (keys / "config").write_text(f"Host cluster\n  HostName 127.0.0.1\n  ProxyJump {host.address}\n  User me\n")
    told = r"ssh://cluster/a\.gasp: cannot be opened: .*the host on the way to 127\.0\.0\.1:22 does not lead there"
    with pytest.raises(RecordingError, match=told):
        record("ssh://cluster/a.gasp")


@pytest.mark.parametrize("address", ["ssh://me:secret@host/a.gasp", "ftp:/me:secret@host/a.gasp"])
def test_a_password_has_no_business_in_an_address(record, address):
    with pytest.raises(RecordingError, match=r"me:\*\*\*@host/a\.gasp: a password here") as caught:
        record(address)
    assert "secret" not in str(caught.value)


class Lost(Exception):
    pass


@contextlib.contextmanager
def connection(store, monkeypatch, writes):
    """Lost for good after so many files have been written."""
    left = [writes]
    put = type(store).put_file

    def counted(self, *given, **others):
        left[0] -= 1
        if left[0] < 0:
            raise Lost("connection reset by peer")
        return put(self, *given, **others)

    with monkeypatch.context() as patch:
        patch.setattr(type(store), "put_file", counted)
        yield


@pytest.mark.parametrize("after", [0, 7, 20, 28, 33, 37])
def test_a_connection_that_is_lost_for_good(record, tmp_path, monkeypatch, elsewhere, store, after):
    """Finished frames can be read, and going on gives what the whole run would have been."""
    disk = record(tmp_path / "disk.gasp")
    address = "memory://runs/a.gasp"
    with (
        connection(store, monkeypatch, after),
        pytest.raises(RecordingError, match=r"is not complete, the connection was lost \(connection reset by peer\)"),
    ):
        record(address)
    elsewhere()
    if Mirror(address).exists():
        found = Recording.open(address)
        for frame in range(found.frame_count):
            assert np.array_equal(found.points(frame), disk.points(frame))
    same(record(address, resume=True), disk)
    elsewhere()
    same(Recording.open(address), disk)


def test_a_connection_that_comes_back_harms_nothing(record, tmp_path, monkeypatch, elsewhere, store):
    """Every third file does not come through."""
    count = iter(range(10_000))
    put = type(store).put_file

    def flaky(self, *given, **others):
        if next(count) % 11 == 5:
            raise Lost("timed out")
        return put(self, *given, **others)

    monkeypatch.setattr(type(store), "put_file", flaky)
    made = record("memory://runs/a.gasp")
    monkeypatch.undo()
    elsewhere()
    same(record(tmp_path / "disk.gasp"), made)


def test_what_diverges_is_kept_there_too(record, store, elsewhere):
    from gasp_core.errors import EngineDivergedError

    class Wrong(flying_points.Ballistic):
        pass

    with pytest.raises(EngineDivergedError):
        simulate_with_fault(record, "memory://runs/a.gasp")
    found = Recording.open("memory://runs/a.gasp")
    assert found.status == "incomplete" and found.frame_count == 3


def simulate_with_fault(record, out):
    scene_options = {"fault": "nan"}
    return record(out, engine=(flying_points.descriptor(), Faulty(scene_options)))


class Faulty(flying_points.Ballistic):
    """Set to fail, whatever the scene says."""

    def __init__(self, options):
        super().__init__()
        self._own = flying_points.Options(**options)

    def open(self, problem, **others):
        return super().open(problem, **{**others, "options": self._own})


def test_copies_are_fetched_anew_only_where_they_have_changed(record, store, monkeypatch):
    record("memory://runs/a.gasp")
    Recording.open("memory://runs/a.gasp")
    fetched = []
    get = type(store).get_file
    monkeypatch.setattr(
        type(store), "get_file", lambda self, *given, **others: (fetched.append(given[0]), get(self, *given, **others))
    )
    found = local_copy("memory://runs/a.gasp")
    assert fetched == []
    (found / "status" / "zarr.json").unlink()
    (found / "zarr.json.strange").write_text("left over")
    local_copy("memory://runs/a.gasp")
    assert [key.rpartition("a.gasp/")[2] for key in fetched] == ["status/zarr.json"]
    assert not (found / "zarr.json.strange").exists()


def test_whoever_reads_while_it_is_made_harms_nothing(record, tmp_path, store):
    """On the same machine: the copy that is read is another one than that which is written."""
    seen = []

    def look(frame):
        found = Recording.open("memory://runs/a.gasp")
        seen.append((found.frame_count, found.status, len(found.points(frame))))

    same(record("memory://runs/a.gasp", recorded=look), record(tmp_path / "disk.gasp"))
    assert [count for count, _, _ in seen] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("key", ["../../evil", "frames/../../../evil/c", "frames//c", "strange.txt", "a/c.0"])
def test_what_has_no_business_here_is_not_fetched(record, store, monkeypatch, tmp_path, key):
    """A listing from somebody else may name anything."""
    record("memory://runs/a.gasp")
    find = type(store).find

    def listed(self, path, **others):
        found = find(self, path, **others)
        return {**found, f"/runs/a.gasp/{key}": {"name": key, "size": 4, "type": "file"}}

    monkeypatch.setattr(type(store), "find", listed)
    before = {path for path in tmp_path.rglob("*") if "read" not in str(path)}
    assert Recording.open("memory://runs/a.gasp").frame_count == 5
    assert {path for path in tmp_path.rglob("*") if "read" not in str(path)} == before
    assert not list(tmp_path.rglob("evil*")) and not list(tmp_path.rglob("strange*"))


def test_what_is_there_stays(record, store):
    record("memory://runs/a.gasp", frames=2)
    before = {key: store.cat_file(key) for key in store.find("/runs/a.gasp")}
    with pytest.raises(RecordingError, match="a recording is there already"):
        record("memory://runs/a.gasp")
    assert {key: store.cat_file(key) for key in store.find("/runs/a.gasp")} == before
    assert record("memory://runs/a.gasp", overwrite=True).frame_count == 5
    store.pipe_file("/runs/mine/notes.txt", b"precious")
    for overwrite in (False, True):
        with pytest.raises(RecordingError, match=r"holds notes\.txt, which is of no recording"):
            record("memory://runs/mine", overwrite=overwrite)
    assert store.cat_file("/runs/mine/notes.txt") == b"precious"


def test_what_cannot_be_read_or_written_is_one_line(record, store, bucket, monkeypatch):
    cases = [
        (lambda: Recording.open("memory://runs/none.gasp"), "there is no such recording"),
        (lambda: Recording.open(f"{bucket}/none.gasp"), "there is no such recording"),
        (lambda: Recording.open("nonsense://runs/a.gasp"), "cannot be opened"),
        (lambda: record("s3://no-such-bucket/a.gasp"), "cannot be written"),
    ]
    for what, said in cases:
        with pytest.raises(RecordingError, match=said) as caught:
            what()
        assert "\n" not in str(caught.value)

    def denied(self, *given, **others):
        raise PermissionError("Forbidden")

    monkeypatch.setattr(type(store), "pipe_file", denied)
    with pytest.raises(RecordingError, match="cannot be written: Forbidden"):
        record("memory://runs/b.gasp")
    assert store.find("/runs/b.gasp") == []
    monkeypatch.setenv("GASP_CACHE", "")
    with pytest.raises(RecordingError, match="GASP_CACHE"):
        Recording.open("memory://runs/a.gasp")


def test_a_damaged_copy_of_notes_costs_time_alone(record, store):
    record("memory://runs/a.gasp")
    found = local_copy("memory://runs/a.gasp")
    (found.parent / ".gasp-mirror.json").write_text("{")
    assert Recording.open("memory://runs/a.gasp").frame_count == 5
    assert json.loads((found.parent / ".gasp-mirror.json").read_text())
