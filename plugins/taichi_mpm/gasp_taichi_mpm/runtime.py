"""The one Taichi runtime of a process: quiet import, one initialisation, and a guard around it.

Taichi is a process-wide singleton. Initialising it again destroys what the first initialisation compiled and, on a
GPU, the memory behind arrays that are still in use, so this module initialises it once for an architecture and
changes architecture only while no session is open. Whoever else in the process calls `ti.init` or `ti.reset` ends what
is ours without a word: kernels go on under other settings, or with arrays that are gone. So a session remembers the
runtime it was opened in, and asks before every use whether it is still there.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import os
import threading
import warnings
from collections.abc import Iterator
from typing import Any

from gasp_core.errors import EngineEnvironmentError, SceneError
from gasp_core.stepping.threads import processors
from gasp_taichi_mpm import cuda_context
from gasp_taichi_mpm.positions import tell_positions_in_a_line

__all__ = ["acquire", "current", "release", "require", "taichi"]

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
            from taichi.lang.ast import ast_transformer_utils
    finally:
        if before is None:
            del os.environ[_BANNER]
        else:
            os.environ[_BANNER] = before
    tell_positions_in_a_line(getattr(ast_transformer_utils, "ASTTransformerContext", None))
    return taichi


taichi = _import_quietly()

_lock = threading.Lock()
_open_sessions = 0
_device: str | None = None
_runtime: Any = None
"""Taichi's own object for what `_initialise` made; it makes another one each time it is initialised or reset."""


@contextlib.contextmanager
def _same_arithmetic() -> Iterator[None]:
    """Leave this thread's arithmetic as it was.

    Taichi has the processor take numbers below 1e-308 for zero from then on, in all Python code of the thread.
    """
    library = None if os.name == "nt" else ctypes.CDLL(None)
    if not (hasattr(library, "fegetenv") and hasattr(library, "fesetenv")):
        yield
        return
    kept = ctypes.create_string_buffer(64)  # 28 to 32 bytes on the systems there are
    library.fegetenv(kept)
    try:
        yield
    finally:
        library.fesetenv(kept)


def _initialise(device: str) -> None:
    global _runtime
    arch = {"cpu": taichi.cpu, "cuda": taichi.cuda}[device]
    if device == "cuda" and not taichi.lang.misc.is_arch_supported(taichi.cuda):
        raise EngineEnvironmentError(
            'engine taichi-mpm: device "cuda" was asked for, but Taichi finds no CUDA GPU here: use device "cpu",'
            " or install a CUDA driver"
        )
    # Taichi prints where it starts; standard output belongs to whoever runs us.
    with contextlib.redirect_stdout(io.StringIO()), _same_arithmetic():
        # A third faster: a product and a sum are one operation. It lets the compiler assume that NaN never occurs, so
        # guards against it look at bits. On a GPU it also replaces logarithms by coarse ones.
        taichi.init(
            arch=arch,
            default_fp=taichi.f32,
            default_ip=taichi.i32,
            fast_math=device == "cpu",
            # Taichi's own data-flow pass takes longer than linear in a kernel's size, and LLVM does it again.
            cfg_optimization=False,
            # Its improvements before LLVM's are on: substeps take two thirds of the time, compiling two to six times
            # as long. They are not named here, so that TI_ADVANCED_OPTIMIZATION=0 turns them off.
            offline_cache=True,
            log_level=taichi.ERROR,
            cpu_max_num_threads=processors(),
            # A task is as many turns of a loop as the loop says, not 512 at the least.
            make_cpu_multithreading_loop=False,
            cpu_block_dim_adaptive=False,
        )
    _runtime = taichi.lang.impl.get_runtime()
    if device == "cuda":
        cuda_context.remember()


def _is_ours() -> bool:
    return _runtime is not None and taichi.lang.impl.get_runtime() is _runtime


def current() -> Any:
    """What `require` is to be given later."""
    return _runtime


def require(runtime: Any) -> None:
    """Make sure that what `current` gave is still there.

    Raises
    ------
    EngineEnvironmentError
        Where Taichi has been initialised or reset since.
    """
    if runtime is not taichi.lang.impl.get_runtime():
        raise EngineEnvironmentError(
            "engine taichi-mpm: Taichi was initialised again or reset in this process (ti.init, ti.reset) while a"
            " session was open, which destroys it: open a new one, from a checkpoint if there is one, or run the engine"
            " isolated"
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
        if _device != device or not _is_ours():
            if _open_sessions and _device != device:
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
