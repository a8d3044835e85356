"""Folders for what is needed for a while, which a process that is killed cannot take away itself.

Each bears a mark, a file that whoever made it holds locked for as long as he lives, however that ends. So the next one
can tell what is left over, and by the mark that it is GASP's: nothing else is ever removed. A number of a process would
not do, which the system gives again.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import tempfile
from collections.abc import Generator
from pathlib import Path

__all__ = ["MARK", "Scratch", "clear_left_over", "scratch_folder"]

try:
    import fcntl
except ImportError:  # Windows has no flock; there nobody can tell what is left over, and it stays.
    fcntl = None

MARK = ".gasp-scratch"
"""Name of the file that a folder is known by."""
_WORDS = b"made by GASP, and to be removed once nobody holds a lock on this file\n"


class Scratch:
    """A folder with a mark that is held; `remove` it, or `keep` it.

    Parameters
    ----------
    parent
        Where it is made; None: where the system has temporary files.
    prefix
        Its name begins so. What others of this prefix have left over there is removed first.

    Raises
    ------
    OSError
        Where it cannot be made.
    """

    def __init__(self, prefix: str, parent: Path | None = None) -> None:
        parent = Path(tempfile.gettempdir()) if parent is None else parent
        clear_left_over(prefix, parent)
        self.path = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
        self._descriptor = os.open(self.path / MARK, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
        # Held before it is a mark: there is no moment in which it looks left over.
        if fcntl is not None:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX)
        os.write(self._descriptor, _WORDS)

    def remove(self) -> None:
        """Take it away with all that is in it, as far as the system lets one; may be called twice."""
        if fcntl is None:
            # Windows removes no file that is open.
            self._release()
        # The mark goes last, so that what resists now is left to the next.
        _remove(self.path)
        self._release()

    def keep(self) -> None:
        """Leave it to whoever wants what is in it: nobody removes it any more."""
        if fcntl is None:
            self._release()
        with contextlib.suppress(OSError):
            (self.path / MARK).unlink()
        self._release()

    def _release(self) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


@contextlib.contextmanager
def scratch_folder(prefix: str, parent: Path | None = None) -> Generator[Path]:
    """A `Scratch` that is removed in the end."""
    scratch = Scratch(prefix, parent)
    try:
        yield scratch.path
    finally:
        scratch.remove()


def clear_left_over(prefix: str, parent: Path) -> None:
    """Remove the folders of a prefix that bear the mark and that nobody holds."""
    if fcntl is None:
        return
    try:
        left = [path for path in parent.iterdir() if path.name.startswith(prefix)]
    except OSError:
        return
    for folder in left:
        with contextlib.suppress(OSError):
            _clear(folder)


def _clear(folder: Path) -> None:
    assert fcntl is not None
    if not stat.S_ISDIR(folder.lstat().st_mode):
        return
    # No link is followed, and no pipe waited for.
    # Open for writing too, or NFS gives no lock of its own.
    descriptor = os.open(folder / MARK, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        own = os.fstat(descriptor)
        if not stat.S_ISREG(own.st_mode) or own.st_uid != os.getuid() or os.read(descriptor, len(_WORDS) + 1) != _WORDS:
            return
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        _remove(folder)
    finally:
        os.close(descriptor)


def _remove(folder: Path) -> None:
    try:
        entries = [path for path in folder.iterdir() if path.name != MARK]
    except OSError:
        return
    for entry in entries:
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry, ignore_errors=True)
        else:
            with contextlib.suppress(OSError):
                entry.unlink()
    shutil.rmtree(folder, ignore_errors=True)
