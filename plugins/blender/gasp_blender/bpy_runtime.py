"""Blender itself: one process has one, and every session a scene of its own in it."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import importlib
import itertools
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Generator
from pathlib import Path
from typing import Any

from gasp_blender.process_exit import skip_teardown
from gasp_core.errors import EngineEnvironmentError

__all__ = ["evaluated", "new_scene", "new_name", "quiet", "remove_scene", "studio"]

_LIBRARIES = "libX11 libXi libXrender libXxf86vm libXfixes libxkbcommon libSM libICE libGL libEGL"
_MEMORY = "/dev/shm"
"""A folder in memory, where there is one: a state is written and read every step, and a disk takes 10 ms for each."""
_numbers = itertools.count(1)
_lock = threading.RLock()
_waiting: list[subprocess.Popen[bytes]] = []
"""Kept: what is freed closes the input that it waits for."""


@contextlib.contextmanager
def quiet() -> Generator[None]:
    """One thread at a time, and what Blender prints goes to stderr: standard output belongs to the caller."""
    with _lock:
        _empty_buffers()
        kept = os.dup(1)
        os.dup2(2, 1)
        try:
            yield
        finally:
            _empty_buffers()
            os.dup2(kept, 1)
            os.close(kept)


def _empty_buffers() -> None:
    """Have what was printed so far, by Python or in C, go where standard output leads now: a pipe is written late."""
    with contextlib.suppress(ValueError, OSError):
        sys.stdout.flush()
    ctypes.CDLL(None).fflush(None)


@functools.cache
def studio() -> tuple[Any, Path]:
    """The module bpy, and the folder in which it keeps the states of soft bodies.

    Blender writes them to files only once its own file has a place, so it gets one that is removed at exit.

    Raises
    ------
    EngineEnvironmentError
        Where bpy cannot be imported: says what to install.
    """
    with quiet():
        try:
            with _one_processor():
                bpy = importlib.import_module("bpy")
        except ModuleNotFoundError as error:
            if error.name != "bpy":
                raise
            raise EngineEnvironmentError("bpy is not installed here: gasp engines install blender") from error
        except ImportError as error:
            raise EngineEnvironmentError(
                f"bpy cannot be loaded ({' '.join(str(error).split())}): it needs the system's {_LIBRARIES}"
            ) from error
        skip_teardown()
        memory = _MEMORY if os.access(_MEMORY, os.W_OK) else None
        folder = Path(tempfile.mkdtemp(prefix="gasp-blender-", dir=memory))
        # Blender's own goes in the clearing up that is skipped.
        _removed_with_us(folder, Path(bpy.app.tempdir))
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "states.blend"), check_existing=False)
        cache = folder / "blendcache_states"
        cache.mkdir()
    return bpy, cache


def _removed_with_us(*folders: Path) -> None:
    """Have a shell wait for the end of this process, however it ends, and remove folders then.

    Its standard input closes with this process; and it is in a session of its own, as workers are killed in groups.
    """
    command = ["/bin/sh", "-c", 'read -r _; rm -rf -- "$@"', "sh", *map(str, folders)]
    waiting = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    _waiting.append(waiting)


@contextlib.contextmanager
def _one_processor() -> Generator[None]:
    """Where Blender starts with one processor it keeps to one thread.

    A cage has too little to do for more: with two on a busy machine a step takes three times as long, waiting.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def new_name(what: str) -> str:
    """A name nothing else in this Blender has."""
    return f"{what}{next(_numbers)}"


def new_scene() -> Any:
    """An empty scene without gravity whose frames go from 0 as far as Blender counts."""
    bpy, _ = studio()
    scene = bpy.data.scenes.new(new_name("gasp"))
    scene.frame_start, scene.frame_end = 0, 1_048_574
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.use_gravity = True
    scene.gravity = (0.0, 0.0, 0.0)
    return scene


def evaluated(scene: Any, frame: int) -> Any:
    """Blender's evaluated state of a scene at a frame.

    Only the scene in the window is simulated, others stand still and say nothing.
    """
    bpy, _ = studio()
    window = bpy.context.window_manager.windows[0]
    if window.scene != scene:
        _show(window, scene)
    scene.frame_set(frame)
    return window.view_layer.depsgraph


def _show(window: Any, scene: Any) -> None:
    window.scene = scene
    # Makes it the active one; without it frames go by and nothing is simulated.
    window.view_layer.update()


def remove_scene(scene: Any) -> None:
    """Remove a scene and all objects in it."""
    bpy, _ = studio()
    window = bpy.context.window_manager.windows[0]
    if window.scene == scene:
        _show(window, next(other for other in bpy.data.scenes if other != scene))
    for one in list(scene.collection.all_objects):
        data = one.data
        bpy.data.objects.remove(one)
        if data is not None and data.users == 0 and isinstance(data, bpy.types.Mesh):
            bpy.data.meshes.remove(data)
    bpy.data.scenes.remove(scene)
