"""A warm start for hdassist: a process that has imported it all and forks one for each run.

Each run is a process with streams, folder, arguments and exit code of its own, as `python -m hdassist` has them;
only the second of imports is shared. Environment and hash seed are shared too, so runs with an environment of
their own, on terminals, or with signals are for true processes (process.py).

Started as a script this is the process that forks; imported, it has what asks it.
"""

from __future__ import annotations

import gc
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

LONGEST = 240  # s of one run


class Warm:
    """The process that forks, as its client sees it: one run at a time."""

    def __init__(self, env: Mapping[str, str]) -> None:
        """Start it with the environment of all its runs."""
        self._socket, other = socket.socketpair(type=socket.SOCK_SEQPACKET)  # a message is whole
        with other:
            # pipes from the beginning: the streams that Python makes when it starts are those of a pipe
            self._process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(other.fileno())], pass_fds=[other.fileno()], env=dict(env),
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            )  # fmt: skip

    def run(self, args: Sequence[str], stdin: bytes, cwd: str) -> tuple[int, bytes, bytes]:
        """Exit code (of subprocess: negative for a signal) and what went to stdout and stderr."""
        pipes = [os.pipe() for _ in range(3)]
        theirs = [pipes[0][0], pipes[1][1], pipes[2][1]]
        socket.send_fds(self._socket, [json.dumps({"args": list(args), "cwd": cwd}).encode()], theirs)
        for fd in theirs:
            os.close(fd)
        with ThreadPoolExecutor(3) as pool:
            fed = pool.submit(_write, pipes[0][1], stdin)
            out, err = (pool.submit(_read, pipe[0]) for pipe in pipes[1:])
        fed.result()
        try:
            return int(self._socket.recv(16)), out.result(), err.result()
        except (ConnectionError, ValueError):  # nothing came
            raise RuntimeError(f"the warm process has ended: {self._process.communicate()[1].decode()}") from None

    def close(self) -> None:
        """End it."""
        self._socket.close()
        self._process.communicate(timeout=LONGEST)


def _write(fd: int, text: bytes) -> None:
    try:
        with open(fd, "wb") as stream:
            stream.write(text)
    except BrokenPipeError:
        pass  # not read to the end, as a run may do


def _read(fd: int) -> bytes:
    with open(fd, "rb") as stream:
        return stream.read()


def _serve(client: socket.socket) -> None:
    """Fork a process for each run and return in it alone, with its streams and folder; ends when nobody asks."""
    while True:
        asked, fds, _, _ = socket.recv_fds(client, 1 << 20, 3)
        if not asked:
            os._exit(0)
        pid = os.fork()
        if not pid:
            break
        for fd in fds:
            os.close(fd)
        _, status = os.waitpid(pid, 0)
        client.send(str(os.waitstatus_to_exitcode(status)).encode())
    client.close()
    for stream, fd in enumerate(fds):
        os.dup2(fd, stream)
        os.close(fd)
    run = json.loads(asked)
    os.chdir(run["cwd"])
    sys.path[0] = run["cwd"]
    sys.argv[1:] = run["args"]
    signal.alarm(LONGEST)


if __name__ == "__main__":
    import hdassist
    from hdassist.cli.main import THREADS

    given = os.environ.copy()
    os.environ.update(dict.fromkeys(THREADS, "1"))  # as main() has it: numpy starts no threads
    for module in walk_packages(hdassist.__path__, "hdassist."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
    for name in os.environ.keys() - given.keys():
        del os.environ[name]
    gc.freeze()  # what is shared stays shared
    assert threading.active_count() == 1
    if Path("/proc/self/task").exists():
        assert len(list(Path("/proc/self/task").iterdir())) == 1
    _serve(socket.socket(fileno=int(sys.argv[1])))
    # the rest is Python's: the end of the run is the end of this process
    runpy.run_module("hdassist", run_name="__main__", alter_sys=True)
