"""The one Taichi runtime of a process: quiet import, one initialisation, and a guard around it.

Taichi is a process-wide singleton. Initialising it again destroys what the first initialisation compiled and, on a
GPU, the memory behind arrays that are still in use, so this module initialises it once for an architecture and
changes architecture only while no session is open.
"""

from __future__ import annotations

import contextlib
import io
import os
import threading
import warnings
from typing import Any

from gasp_core.engine.threads import processors
from gasp_core.errors import EngineEnvironmentError, SceneError

__all__ = ["acquire", "release", "taichi"]

_BANNER = "ENABLE_TAICHI_HEADER_PRINT"


def _import_quietly() -> Any:
    """Import Taichi without its banner on standard output, which belongs to whoever runs us."""
    before = os.environ.get(_BANNER)
    os.environ[_BANNER] = "0"
    try:
        # Its sources hold invalid escape sequences, of which newer Pythons warn.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import taichi
    finally:
        if before is None:
            del os.environ[_BANNER]
        else:
            os.environ[_BANNER] = before
    return taichi


taichi = _import_quietly()

_lock = threading.Lock()
_open_sessions = 0
_device: str | None = None


def _initialise(device: str) -> None:
    arch = {"cpu": taichi.cpu, "cuda": taichi.cuda}[device]
    if device == "cuda" and not taichi.lang.misc.is_arch_supported(taichi.cuda):
        raise EngineEnvironmentError(
            'engine taichi-mpm: device "cuda" was asked for, but Taichi finds no CUDA GPU here: use device "cpu",'
            " or install a CUDA driver"
        )
    # Taichi prints where it starts; standard output belongs to whoever runs us.
    with contextlib.redirect_stdout(io.StringIO()):
        # fast_math lets the compiler assume that NaN never occurs; the guards against it would be compiled away.
        taichi.init(
            arch=arch,
            default_fp=taichi.f32,
            default_ip=taichi.i32,
            fast_math=False,
            # Taichi's own data-flow pass takes longer than linear in a kernel's size, and LLVM does it again.
            cfg_optimization=False,
            offline_cache=True,
            log_level=taichi.ERROR,
            cpu_max_num_threads=processors(),
        )


def acquire(device: str) -> None:
    """Count one session in, initialising Taichi for its device where needed.

    Raises
    ------
    SceneError
        For a device that is neither "cpu" nor "cuda", or while a session on the other one is open.
    EngineEnvironmentError
        Where there is no CUDA GPU.
    """
    global _open_sessions, _device
    if device not in ("cpu", "cuda"):
        raise SceneError(f'engine taichi-mpm has no device {device!r}: use "cpu" or "cuda"')
    with _lock:
        if _device != device:
            if _open_sessions:
                raise SceneError(
                    f'engine taichi-mpm: a session on "{_device}" is open, and Taichi serves one device a process:'
                    f' close it before opening one on "{device}", or run one of them isolated'
                )
            _initialise(device)
            _device = device
        _open_sessions += 1


def release() -> None:
    """Count one session out."""
    global _open_sessions
    with _lock:
        _open_sessions = max(0, _open_sessions - 1)
