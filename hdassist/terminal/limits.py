"""Memory that a run needs of the system."""

from hdassist.errors import DataError, Fault

ADDRESSES = 512_000_000  # bytes: with less OpenBLAS waits for ever while it is loaded, or ends the process


def require_memory() -> None:
    """Raise DataError where the addresses that a process may have (ulimit -v) do not hold numpy and its solvers."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if 0 <= limit < ADDRESSES:
        words = f"the memory that a process may have is {limit / 1e6:.0f} MB: too little to compute with"
        raise DataError(words, f"ulimit -v {ADDRESSES // 1000} or more, in kB", Fault.SYSTEM_LIMITS)
