"""All that differs by operating system: locks, processes, signals, the private folder, terminals, commands to be typed.

No other module asks which system it runs on. Windows has no fork, no lock of a file that others may still read, and no
owners that Python shows; macOS has no /proc, and no process of it is forked beside its own frameworks.

The locks are calls of the standard library (six lines): filelock and portalocker take 67 and 80 ms to import, filelock
empties the file that it locks, and portalocker locks its content on Windows against everybody who reads it.

Stops are heard before anything else is imported, and need this module: imports that take long stand in functions.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import stat
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from asyncio import AbstractEventLoop
    from multiprocessing.connection import Connection
    from pathlib import Path

SPAWN = "HDASSIST_SPAWN"  # variable: every process is spawned, as on Windows; for tests
BINARY = getattr(os, "O_BINARY", 0)  # a flag of files in which no end of a line is translated


# --- locks


def locks_beside() -> bool:
    """Return whether a file is locked by another one beside it.

    A lock of Windows keeps everybody else from reading the bytes that it holds, and an open file can't be replaced.
    """
    return sys.platform == "win32"


def lock(descriptor: int) -> None:
    """Take the lock of an open file, which goes when the file is closed or the process ends, in any way.

    descriptor: of the file; on Windows the lock is of its first byte.
    Raises BlockingIOError: another process has the lock; OSError: the file system has no locks, which Windows reports
    in the same way as a lock that another process has.
    """
    if sys.platform == "win32":
        import msvcrt

        # Windows locks a range of bytes from the position on: the first byte
        os.lseek(descriptor, 0, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError as error:  # EACCES on Windows, another error under Wine
            raise BlockingIOError(error.errno, error.strerror) from None
    else:
        import fcntl

        # of the open file, not of the process: copies of the descriptor share it
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def unlock(descriptor: int) -> None:
    """Give up the lock of an open file, also for copies of its descriptor."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(descriptor, 0, os.SEEK_SET)
        with suppress(OSError):
            msvcrt.locking(descriptor, msvcrt.LK_UNLCK, 1)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_UN)


# --- a folder for this user alone

_OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
_AS_IT_IS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)  # no link is followed, no pipe waited for


class UnsafeFolderError(OSError):
    """A folder of the cache that another user can write to."""


class PrivateFolder:
    """An open folder whose files no other user can write."""

    def __init__(self, path: Path, descriptor: int | None) -> None:
        """Take a folder that is open.

        path: of the folder; descriptor: of the open folder, through which files are reached so that no link is followed
        on the way, or None on Windows, which opens no folders.
        """
        self.path = path
        self.descriptor = descriptor

    def read(self, name: str, at_most: int) -> bytes | None:
        """Return the content of a file of this user; None for any other file.

        name: of the file; at_most: bytes that it may have. Raises OSError: there is no such file.
        """
        descriptor = os.open(
            self._place(name),
            os.O_RDONLY | BINARY | _AS_IT_IS,
            dir_fd=self.descriptor,
        )
        with os.fdopen(descriptor, "rb") as file:
            about = os.fstat(descriptor)
            # another user's file could hold anything
            if not _is_own(about) or about.st_size > at_most:
                return None
            return file.read()

    def note_use(self, name: str) -> None:
        """Give a file the time of now, as of the one that was used last; without a word where that can't be done."""
        with suppress(OSError):
            if self.descriptor is None:
                os.utime(self._place(name))  # fails while another process reads it
            else:
                os.utime(name, dir_fd=self.descriptor, follow_symlinks=False)

    def write(self, name: str, content: bytes) -> None:
        """Write a file that is not there yet. Raises OSError: it is, or it cannot be written."""
        # O_EXCL: never into a file, or through a link, that is there already
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | BINARY | _AS_IT_IS
        descriptor = os.open(
            self._place(name),
            flags,
            0o600,
            dir_fd=self.descriptor,
        )
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)

    def replace(self, name: str, new_name: str) -> None:
        """Give a file another name, in place of the file that has it."""
        folder = self.descriptor
        os.replace(
            self._place(name),
            self._place(new_name),
            src_dir_fd=folder,
            dst_dir_fd=folder,
        )

    def remove(self, name: str) -> None:
        """Remove a file. Raises OSError: it cannot be removed."""
        os.unlink(self._place(name), dir_fd=self.descriptor)

    def names(self) -> list[str]:
        """Return the names of all that is in the folder."""
        if self.descriptor is None:
            return [path.name for path in self.path.iterdir()]
        return os.listdir(self.descriptor)  # noqa: PTH208 (no path lists an open folder)

    def own_status(self, name: str) -> os.stat_result | None:
        """Return what is known of a file that this user alone can write; None for any other file."""
        try:
            about = os.stat(
                self._place(name),
                dir_fd=self.descriptor,
                follow_symlinks=False,
            )
        except OSError:
            return None
        return about if _is_own(about) else None

    def _place(self, name: str) -> str:
        return str(self.path / name) if self.descriptor is None else name


@contextmanager
def private_folder(
    named: Path,
    own: str,
    *,
    makes: bool,
) -> Iterator[PrivateFolder]:
    """Open a folder for this user alone.

    named: the folder that the user names; own: the name of a folder in it, which is opened; makes: whether folders are
    made that are not there.
    Raises FileNotFoundError: there is none; UnsafeFolderError: another user can write to one of the two; OSError,
    ValueError: it cannot be opened.
    """
    if makes:
        named.mkdir(
            mode=0o700,
            parents=True,
            exist_ok=True,
        )
    if sys.platform == "win32":
        yield _folder_of_profile(named / own, makes=makes)
        return
    user = os.geteuid()
    parent = os.open(named, os.O_RDONLY | os.O_DIRECTORY)
    try:
        about = os.fstat(parent)
        # who can write to the parent can replace the folder
        if about.st_uid not in (user, 0) or about.st_mode & _OTHERS_MAY_WRITE:
            raise UnsafeFolderError(f"another user can write to {named}")
        # made through the open parent, so that its path cannot be exchanged meanwhile
        if makes:
            with suppress(FileExistsError):
                os.mkdir(own, 0o700, dir_fd=parent)
        folder = os.open(
            own,
            os.O_RDONLY | os.O_DIRECTORY | _AS_IT_IS,
            dir_fd=parent,
        )
    finally:
        os.close(parent)
    try:
        # of the open folder, not of its path
        about = os.fstat(folder)
        if about.st_uid != user or about.st_mode & _OTHERS_MAY_WRITE:
            raise UnsafeFolderError(f"another user can write to {named / own}")
        yield PrivateFolder(named / own, folder)
    finally:
        os.close(folder)


def _folder_of_profile(path: Path, *, makes: bool) -> PrivateFolder:
    """Return a folder of the user's profile, to which Windows lets no other user.

    Raises UnsafeFolderError: it lies elsewhere, where Python does not show who can write; OSError: it is not there.
    """
    profile = type(path).home()
    # Windows protects the profile; folders elsewhere may be open to all
    if not path.resolve().is_relative_to(profile.resolve()):
        raise UnsafeFolderError(f"{path.parent} is outside {profile}; another user may be able to write to it")
    if makes:
        path.mkdir(mode=0o700, exist_ok=True)
    if not path.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    return PrivateFolder(path, None)


def _is_own(about: os.stat_result) -> bool:
    """Return whether it is a regular file that this user alone can write."""
    is_file = stat.S_ISREG(about.st_mode)
    if sys.platform == "win32":  # the folder of the profile decides
        return is_file
    return is_file and about.st_uid == os.geteuid() and not about.st_mode & _OTHERS_MAY_WRITE


# --- processes

_PR_SET_PDEATHSIG = 1  # linux/prctl.h
_LOOK_EVERY = 0.02  # s


def start_method() -> str:
    """Return how processes begin: with all that is imported here already (a second each), where that can be had.

    A fork of a process with threads may inherit a lock that nobody will open; there a process without threads, which
    has imported the same, does the forking. Solvers start threads that Python does not know of; the system does.
    """
    if sys.platform != "linux" or os.environ.get(SPAWN):
        return "spawn"
    import threading
    from pathlib import Path

    tasks = Path("/proc/self/task")
    # threads of C libraries are counted too
    threads = len(list(tasks.iterdir())) if tasks.exists() else threading.active_count()
    # a fork copies locks that other threads hold, and nobody opens
    return "fork" if threads == 1 else "forkserver"


def has_forkserver() -> bool:
    """Return whether a process can be asked to fork itself, so that a process begins within milliseconds."""
    return sys.platform != "win32" and not os.environ.get(SPAWN)


def begin_resource_tracker() -> None:
    """Begin the process by which multiprocessing removes what others leave behind, if there is one.

    It is begun now, as it lets signals in that are held back, and inherits the streams of now.
    """
    if sys.platform != "win32":
        from multiprocessing import resource_tracker

        resource_tracker.ensure_running()


def is_killed_with_parent(parent: int) -> bool:
    """Have the system kill this process when its parent ends, even in the middle of a solver.

    parent: process id of the process that began this one. Returns whether the system does so, on Linux alone: where the
    parent is another process than that, and on other systems, this process has to look after that itself.
    """
    if sys.platform != "linux":
        return False
    import ctypes

    is_asked = ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL) == 0
    # the parent may have ended before the request
    return is_asked and os.getppid() == parent


def has_ended(process: int) -> bool:
    """Return whether a process has ended already; False where the system has no quick answer."""
    if sys.platform != "linux":
        return False
    from pathlib import Path

    return not Path("/proc", str(process)).exists() and Path("/proc/self").exists()


def core_count() -> int:
    """Return the number of cores that this process may use."""
    if sys.platform == "linux":
        # containers and taskset restrict a process to some cores
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def address_limit() -> int | None:
    """Return the bytes of addresses that this process may have (ulimit -v); None if there is no limit."""
    if sys.platform == "win32":
        return None
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return limit if limit >= 0 else None


def limits_hint(hint: str) -> str:
    """Return the remedy where the system refuses a process more of something.

    hint: that of systems with `ulimit`, which Windows has not.
    """
    return "close other programs to free memory" if sys.platform == "win32" else hint


# --- signals

_STOP_WORDS = {  # of each signal that ends a command; SIGBREAK: Ctrl-Break, or a console window that is closed
    "SIGINT": "interrupted",
    "SIGTERM": "terminated",
    "SIGHUP": "hung up",
    "SIGBREAK": "interrupted",
}
STOPS = {getattr(signal, name): verb for name, verb in _STOP_WORDS.items() if hasattr(signal, name)}


@contextmanager
def stops_held_back() -> Iterator[None]:
    """Hear stops later: for the moment in which a process begins, which has to inherit that.

    Windows cannot hold them back: for that moment neither this process nor the new one hears Ctrl-C.
    """
    if sys.platform == "win32":
        import ctypes

        console = ctypes.windll.kernel32
        console.SetConsoleCtrlHandler(None, True)
        try:
            yield
        finally:
            console.SetConsoleCtrlHandler(None, False)
    else:
        # blocked signals wait, and arrive when the mask is restored
        before = signal.pthread_sigmask(signal.SIG_BLOCK, STOPS)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_stops_in() -> None:
    """Hear stops again in a process that was begun while they were held back."""
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)


def hear_in_loop(loop: AbstractEventLoop, action: Callable[[int], None]) -> None:
    """Have a loop of asyncio do something at the first stop that a terminal or another process sends, unless ignored.

    action: takes the number of the signal; afterwards these signals do what they do in a process that has just begun.
    """
    # a closed terminal is noticed otherwise
    numbers = [number for number in STOPS if signal.Signals(number).name != "SIGHUP"]

    def once(number: int) -> None:
        for further_number in numbers:
            if sys.platform != "win32":
                # a second stop ends the process the usual way
                loop.remove_signal_handler(further_number)
            elif signal.getsignal(further_number) is not signal.SIG_IGN:
                signal.signal(further_number, signal.SIG_DFL)
        action(number)

    for number in numbers:
        if signal.getsignal(number) is signal.SIG_IGN:
            continue
        with suppress(RuntimeError, ValueError):  # not in this thread
            if sys.platform == "win32":
                signal.signal(number, lambda number, _: loop.call_soon_threadsafe(once, number))
            else:
                loop.add_signal_handler(number, once, number)


async def wait_until_readable(connection: Connection, sentinel: int) -> bool:
    """Wait, beside all else that the running loop does, until there is something to read or the other end is closed.

    sentinel: of the process at the other end, which may end before it has opened it. Returns whether to read.
    """
    import asyncio

    if sys.platform == "win32":  # its loop watches no pipe of multiprocessing
        from multiprocessing.connection import wait

        while not (ready := wait([connection, sentinel], timeout=0)):
            await asyncio.sleep(_LOOK_EVERY)
        return connection in ready
    loop = asyncio.get_running_loop()
    ready = asyncio.Event()
    loop.add_reader(connection.fileno(), ready.set)
    try:
        await ready.wait()
    finally:
        loop.remove_reader(connection.fileno())
    return True


def wait_for_hangup(descriptor: int) -> bool:
    """Wait until the terminal of an open stream is gone; returns whether it is.

    No signal reports that where SIGHUP is ignored (nohup). Windows ends all processes of a console that is closed:
    there, and where the system cannot tell, the answer is False at once.
    """
    if sys.platform == "win32":
        return False
    import select

    terminal = select.poll()
    # no event is asked for
    terminal.register(descriptor, 0)  # a hang-up is reported unasked
    return any(event & (select.POLLHUP | select.POLLERR) for _, event in terminal.poll())


# --- what is written and typed

_PLAIN_WORD = r"[A-Za-z0-9_./\\:=+-]+"  # that cmd.exe and PowerShell take as it is
_DEVICE = r"(?i:con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])( *\..*)?"  # of Windows


def command_line(words: Sequence[str]) -> str:
    """Return a command as the shell of this system takes it, on Windows as both cmd.exe and PowerShell do."""
    if sys.platform == "win32":
        return windows_command_line(words)
    from shlex import join

    return join(words)


def windows_command_line(words: Sequence[str]) -> str:
    """Return a command as cmd.exe and PowerShell take it: whatever has a sign of its own for them in double quotes.

    A double quote within a word is written as cmd.exe takes it alone; % and $ with a name of a variable are expanded.
    """
    import re
    from subprocess import list2cmdline

    written = []
    for word in words:
        quoted = list2cmdline([word])
        # list2cmdline quotes for C programs only, not for the shell
        if quoted == word and not re.fullmatch(_PLAIN_WORD, word):
            backslashes = word[len(word.rstrip("\\")) :]  # at the end: before a quote they are doubled
            quoted = f'"{word}{backslashes}"'
        written.append(quoted)
    return " ".join(written)


def command_quote() -> str:
    """Return the quote in which `command_line` writes words with spaces."""
    return '"' if sys.platform == "win32" else "'"


@cache
def broken_line_end() -> str:
    """Return the sign at the end of a line for which the calling shell reads on; empty for an unknown shell."""
    if sys.platform != "win32":
        return " \\"
    from shellingham import ShellDetectionFailure, detect_shell

    try:
        shell, _ = detect_shell()
    except (ShellDetectionFailure, OSError):
        return ""
    return {"cmd": " ^", "powershell": " `", "pwsh": " `", "bash": " \\"}.get(shell, "")


def why_not_a_file(path: str) -> str:
    """Return why this system makes no file of such a name, or an empty text."""
    return why_not_a_windows_file(path) if sys.platform == "win32" else ""


def why_not_a_windows_file(path: str) -> str:
    """Return why Windows makes no file of such a name, or an empty text."""
    import re
    from pathlib import PureWindowsPath

    named = PureWindowsPath(path)
    # a drive letter has a colon of its own
    for part in named.parts[1:] if named.anchor else named.parts:
        if re.fullmatch(_DEVICE, part):
            return f"{part} is the name of a device on Windows"
        if ":" in part:
            return f"because of its colon, {part} means a stream of another file"
        if refused := re.search(r'[<>"|?*\x00-\x1f]', part):
            return f"a file name cannot contain {refused[0]!r} on Windows"
        if part.endswith((" ", ".")) and part not in (".", ".."):
            return "a file name cannot end in a dot or a space on Windows"
    return ""


def takes_codes(stream: TextIO) -> bool:
    """Return whether the terminal of a stream takes control codes, which a Windows console has to be set to first."""
    if sys.platform == "win32":
        import ctypes
        import msvcrt

        with suppress(OSError, ValueError):  # it has no descriptor
            mode = ctypes.c_ulong()
            console = ctypes.windll.kernel32
            handle = ctypes.c_void_p(msvcrt.get_osfhandle(stream.fileno()))
            # fails if the stream is no console
            if console.GetConsoleMode(handle, ctypes.byref(mode)):
                return bool(console.SetConsoleMode(handle, mode.value | 4))  # virtual terminal processing
        return False
    return True


def output_encoding(stream: Any) -> str:
    """Return the encoding of answers for programs and files.

    stream: of text, whose encoding it is. On Windows this is a code page without most letters: there answers are UTF-8,
    as in the files that we write.
    """
    return "utf-8" if sys.platform == "win32" else stream.encoding or "utf-8"


def pipe_stream(stream: TextIO) -> TextIO:
    """Return a stream that raises BrokenPipeError when its reader has gone, for which Windows has another error."""
    if sys.platform != "win32" or stream.isatty():
        return stream
    try:
        raw = _PipeWriter(stream.fileno(), "wb", closefd=False)
    except (OSError, ValueError):  # it has no descriptor
        return stream
    is_ended_by_line = getattr(stream, "line_buffering", False)
    buffered = io.BufferedWriter(raw)
    return io.TextIOWrapper(
        buffered,
        stream.encoding,
        stream.errors,
        line_buffering=is_ended_by_line,
    )


class _PipeWriter(io.FileIO):
    """A file or pipe of Windows to write to."""

    def write(self, data: Any) -> int:
        """Write bytes. Raises BrokenPipeError: the reader of the pipe has gone; OSError: another fault."""
        try:
            return super().write(data)
        except OSError as error:
            if error.errno == errno.EINVAL:
                raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE)) from None
            raise
