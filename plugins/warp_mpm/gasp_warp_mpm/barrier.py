"""Where the threads of a step share its work and wait for each other: in native code, because waking a Python thread
takes longer than a phase of a small scene.

What there is to do in a phase is numbered, and every thread takes the next number: whoever is slower, because the
machine has other things to do or its part is more work, does less. Who does what changes no result.

Warp runs a kernel on the CPU in the thread that launches it, without the interpreter's lock. A few such launches, one
a thread, share the phases of every step between them.
"""

# No `from __future__ import annotations`: Warp reads the types themselves.
import warp as wp

__all__ = ["BARRIER_WIDTH", "take_next", "wait_for_all"]

BARRIER_WIDTH = 96
"""Length of a barrier's memory: arrivals, the number of times all had arrived, and the next number to be taken, cache
lines apart."""


@wp.func_native(
    """
    typedef void (*Yield)();
    int* arrivals = (int*)memory.data;
    int* rounds = arrivals + 32;
    const int round = __atomic_load_n(rounds, __ATOMIC_ACQUIRE);
    if (__atomic_add_fetch(arrivals, 1, __ATOMIC_ACQ_REL) == workers) {
        __atomic_store_n(arrivals, 0, __ATOMIC_RELAXED);
        __atomic_store_n(arrivals + 64, 0, __ATOMIC_RELAXED);
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
    """Return when `workers` threads have come here; numbers are taken from 0 again."""


@wp.func_native("""return __atomic_fetch_add((int*)memory.data + 64, count, __ATOMIC_RELAXED);""")
def take_next(memory: wp.array(dtype=wp.int32), count: int) -> int:
    """The first of the next `count` numbers that nobody has taken since all met."""
