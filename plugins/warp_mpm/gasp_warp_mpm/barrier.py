"""Where the threads of a step wait for each other: in native code, because waking a Python thread takes longer than a
phase of a small scene.

Warp runs a kernel on the CPU in the thread that launches it, without the interpreter's lock. A few such launches, one
a thread, share the phases of every step between them.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
import warp as wp

__all__ = ["BARRIER_WIDTH", "wait_for_all"]

BARRIER_WIDTH = 64
"""Length of a barrier's memory: arrivals, and a cache line away from it the number of times all had arrived."""


@wp.func_native(
    """
    typedef void (*Yield)();
    int* arrivals = (int*)memory.data;
    int* rounds = arrivals + 32;
    const int round = __atomic_load_n(rounds, __ATOMIC_ACQUIRE);
    if (__atomic_add_fetch(arrivals, 1, __ATOMIC_ACQ_REL) == workers) {
        __atomic_store_n(arrivals, 0, __ATOMIC_RELAXED);
        __atomic_add_fetch(rounds, 1, __ATOMIC_ACQ_REL);
        return;
    }
    for (int spins = 0; __atomic_load_n(rounds, __ATOMIC_ACQUIRE) == round; ++spins) {
        // More threads than processors: whoever is waited for may be waiting for this one's processor.
        if (spins > 4000 && yield_address) ((Yield)yield_address)();
    #if defined(__x86_64__) || defined(_M_X64)
        else __builtin_ia32_pause();
    #endif
    }
    """
)
def wait_for_all(memory: wp.array(dtype=wp.int32), workers: int, yield_address: wp.uint64):
    """Return when `workers` threads have come here."""
