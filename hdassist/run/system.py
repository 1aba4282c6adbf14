"""Code that depends on the operating system: locks, processes, signals, the private folder, terminals, commands.

No other module checks the operating system. Windows has no fork, no file lock that lets others read, and no file owners
that Python shows. macOS has no /proc, and its frameworks do not support forked processes.

The locks are calls of the standard library (six lines). filelock and portalocker take 67 and 80 ms to import, filelock
empties the file that it locks, and portalocker prevents every other process from reading the content on Windows.

Stops are handled before anything else is imported and need this module, so slow imports are inside functions.
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

SPAWN = "HDASSIST_SPAWN"  # environment variable that makes every process spawned, as on Windows; for tests
BINARY = getattr(os, "O_BINARY", 0)  # flag for opening files without translation of line ends


# --- locks


def locks_beside() -> bool:
    """Return whether the lock of a file is on a separate lock file.

    A lock on Windows prevents all other processes from reading the locked bytes, and an open file cannot be replaced.
    """
    return sys.platform == "win32"


def lock(descriptor: int) -> None:
    """Take the lock of an open file, which lasts until the file is closed or the process ends for any reason.

    descriptor: descriptor of the file; on Windows its first byte is locked.

    Raises BlockingIOError if another process has the lock, and OSError if the file system has no locks. On Windows,
    BlockingIOError is raised in both cases.
    """
    if sys.platform == "win32":
        import msvcrt

        # Windows locks a range of bytes from the current position: the first byte
        os.lseek(descriptor, 0, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError as error:  # EACCES on Windows, another error under Wine
            raise BlockingIOError(error.errno, error.strerror) from None
    else:
        import fcntl

        # the lock belongs to the open file, not to the process, so copies of the descriptor share it
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def unlock(descriptor: int) -> None:
    """Release the lock of an open file, including all copies of its descriptor."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(descriptor, 0, os.SEEK_SET)
        with suppress(OSError):
            msvcrt.locking(descriptor, msvcrt.LK_UNLCK, 1)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_UN)


# --- private folder of the user

_OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
_AS_IT_IS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)  # follow no link and do not wait for a pipe


class UnsafeFolderError(OSError):
    """Error for a cache folder to which another user can write."""


class PrivateFolder:
    """An open folder whose files only this user can write."""

    def __init__(self, path: Path, descriptor: int | None) -> None:
        """Store an open folder.

        path: path of the folder.
        descriptor: descriptor of the open folder, through which files are accessed so that no link in the path is
            followed; None on Windows, which does not open folders.
        """
        self.path = path
        self.descriptor = descriptor

    def read(self, name: str, at_most: int) -> bytes | None:
        """Return the content of a file that only this user can write; None for any other file and for a larger file.

        name: name of the file.
        at_most: largest accepted size [bytes].

        Raises OSError if there is no such file.
        """
        descriptor = os.open(
            self._place(name),
            os.O_RDONLY | BINARY | _AS_IT_IS,
            dir_fd=self.descriptor,
        )
        with os.fdopen(descriptor, "rb") as file:
            about = os.fstat(descriptor)
            # a file of another user could contain anything
            if not _is_own(about) or about.st_size > at_most:
                return None
            return file.read()

    def note_use(self, name: str) -> None:
        """Set the time of a file to the present, which marks it as used; errors are ignored."""
        with suppress(OSError):
            if self.descriptor is None:
                os.utime(self._place(name))  # fails while another process reads the file
            else:
                os.utime(name, dir_fd=self.descriptor, follow_symlinks=False)

    def write(self, name: str, content: bytes) -> None:
        """Write a new file.

        Raises OSError if the file already exists or cannot be written.
        """
        # O_EXCL prevents writing into an existing file or through a link
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
        """Rename a file, in place of any file that has the new name."""
        folder = self.descriptor
        os.replace(
            self._place(name),
            self._place(new_name),
            src_dir_fd=folder,
            dst_dir_fd=folder,
        )

    def remove(self, name: str) -> None:
        """Remove a file.

        Raises OSError if it cannot be removed.
        """
        os.unlink(self._place(name), dir_fd=self.descriptor)

    def names(self) -> list[str]:
        """Return the names of all entries of the folder."""
        if self.descriptor is None:
            return [path.name for path in self.path.iterdir()]
        return os.listdir(self.descriptor)  # noqa: PTH208 (pathlib cannot list a folder by its descriptor)

    def own_status(self, name: str) -> os.stat_result | None:
        """Return the status of a file that only this user can write; None for any other file."""
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
    """Open a private folder of this user.

    named: folder given by the user.
    own: name of the private folder within it.
    makes: whether missing folders are created.

    Raises FileNotFoundError if there is no such folder, UnsafeFolderError if another user can write to one of the two,
    OSError or ValueError if it cannot be opened.
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
        # a user who can write to the parent can replace the folder
        if about.st_uid not in (user, 0) or about.st_mode & _OTHERS_MAY_WRITE:
            raise UnsafeFolderError(f"another user can write to {named}")
        # the folder is created through the open parent, whose path cannot be exchanged in the meantime
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
        # the status is that of the open folder, because its path may be exchanged
        about = os.fstat(folder)
        if about.st_uid != user or about.st_mode & _OTHERS_MAY_WRITE:
            raise UnsafeFolderError(f"another user can write to {named / own}")
        yield PrivateFolder(named / own, folder)
    finally:
        os.close(folder)


def _folder_of_profile(path: Path, *, makes: bool) -> PrivateFolder:
    """Return a folder in the user's profile, to which Windows gives no other user access.

    Raises UnsafeFolderError if it is elsewhere, where Python does not show who can write, OSError if it does not exist.
    """
    profile = type(path).home()
    # Windows protects the profile; folders elsewhere may be open to all users
    if not path.resolve().is_relative_to(profile.resolve()):
        raise UnsafeFolderError(f"another user may be able to write to {path.parent}, because it is outside {profile}")
    if makes:
        path.mkdir(mode=0o700, exist_ok=True)
    if not path.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    return PrivateFolder(path, None)


def _is_own(about: os.stat_result) -> bool:
    """Return whether a status belongs to a regular file that only this user can write."""
    is_file = stat.S_ISREG(about.st_mode)
    if sys.platform == "win32":  # on Windows the folder in the profile ensures this
        return is_file
    return is_file and about.st_uid == os.geteuid() and not about.st_mode & _OTHERS_MAY_WRITE


# --- processes

_PR_SET_PDEATHSIG = 1  # from linux/prctl.h
_LOOK_EVERY = 0.02  # s; interval between checks


def start_method() -> str:
    """Return the start method of processes, which is a fork if possible because importing all modules takes a second.

    A fork of a process with threads may inherit a lock that is never released. In that case, a server process without
    threads, which has imported the same modules, is forked. Threads are counted by the system, because solvers start
    threads that Python does not know.
    """
    if sys.platform != "linux" or os.environ.get(SPAWN):
        return "spawn"
    import threading
    from pathlib import Path

    tasks = Path("/proc/self/task")
    # the count of the system includes threads of C libraries
    threads = len(list(tasks.iterdir())) if tasks.exists() else threading.active_count()
    # a fork copies locks of other threads, which are never released in the copy
    return "fork" if threads == 1 else "forkserver"


def has_forkserver() -> bool:
    """Return whether a fork server is available, which starts a process within milliseconds."""
    return sys.platform != "win32" and not os.environ.get(SPAWN)


def begin_resource_tracker() -> None:
    """Start the resource tracker of multiprocessing, which removes leftovers of other processes; Windows has none.

    The tracker is started explicitly because it unblocks signals and inherits the current streams.
    """
    if sys.platform != "win32":
        from multiprocessing import resource_tracker

        resource_tracker.ensure_running()


def is_killed_with_parent(parent: int) -> bool:
    """Ask the system to kill this process when its parent ends, even in the middle of a solver.

    parent: id of the process that started this one.

    Returns whether the system will do so, which requires Linux and that process as the direct parent. Otherwise this
    process must watch its parent itself.
    """
    if sys.platform != "linux":
        return False
    import ctypes

    is_asked = ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL) == 0
    # the parent may have ended before the request
    return is_asked and os.getppid() == parent


def has_ended(process: int) -> bool:
    """Return whether a process has ended; False if the system has no fast check."""
    if sys.platform != "linux":
        return False
    from pathlib import Path

    return not Path("/proc", str(process)).exists() and Path("/proc/self").exists()


def core_count() -> int:
    """Return the number of cores available to this process."""
    if sys.platform == "linux":
        # containers and taskset restrict a process to some cores
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def address_limit() -> int | None:
    """Return the limit of the address space of this process [bytes] (ulimit -v); None if there is no limit."""
    if sys.platform == "win32":
        return None
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return limit if limit >= 0 else None


def limits_hint(hint: str) -> str:
    """Return the remedy for a system that refuses further resources to a process.

    hint: remedy for systems with `ulimit`, which Windows lacks.
    """
    return "close other programs to free memory" if sys.platform == "win32" else hint


# --- signals

_STOP_WORDS = {  # description of each signal that ends a command; SIGBREAK: Ctrl-Break, or a closed console window
    "SIGINT": "interrupted",
    "SIGTERM": "terminated",
    "SIGHUP": "hung up",
    "SIGBREAK": "interrupted",
}
STOPS = {getattr(signal, name): verb for name, verb in _STOP_WORDS.items() if hasattr(signal, name)}


@contextmanager
def stops_held_back() -> Iterator[None]:
    """Delay stops during the start of a process, which must inherit this state.

    Windows cannot delay them, so Ctrl-C is ignored by this process and by the new one during the block.
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
        # blocked signals remain pending and are delivered when the mask is restored
        before = signal.pthread_sigmask(signal.SIG_BLOCK, STOPS)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_stops_in() -> None:
    """Accept stops again in a process that was started while they were delayed."""
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)


def hear_in_loop(loop: AbstractEventLoop, action: Callable[[int], None]) -> None:
    """Call an action in an asyncio loop at the first stop from a terminal or another process, unless it is ignored.

    action: function of the signal number; afterwards these signals have their default effect.
    """
    # a closed terminal is detected in another way
    numbers = [number for number in STOPS if signal.Signals(number).name != "SIGHUP"]

    def once(number: int) -> None:
        for further_number in numbers:
            if sys.platform != "win32":
                # a second stop ends the process in the usual way
                loop.remove_signal_handler(further_number)
            elif signal.getsignal(further_number) is not signal.SIG_IGN:
                signal.signal(further_number, signal.SIG_DFL)
        action(number)

    for number in numbers:
        if signal.getsignal(number) is signal.SIG_IGN:
            continue
        with suppress(RuntimeError, ValueError):  # fails outside the main thread
            if sys.platform == "win32":
                signal.signal(number, lambda number, _: loop.call_soon_threadsafe(once, number))
            else:
                loop.add_signal_handler(number, once, number)


async def wait_until_readable(connection: Connection, sentinel: int) -> bool:
    """Wait in the running loop until a connection can be read or its other end is closed.

    sentinel: sentinel of the process at the other end, which may end before it has opened the connection.

    Returns whether there is something to read.
    """
    import asyncio

    if sys.platform == "win32":  # the loop on Windows does not watch pipes of multiprocessing
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
    """Wait until the terminal of an open stream is closed, and return whether it was closed.

    No signal reports the closing if SIGHUP is ignored (nohup). Windows ends all processes of a closed console. On
    Windows, and on systems that cannot detect the closing, the result is False at once.
    """
    if sys.platform == "win32":
        return False
    import select

    terminal = select.poll()
    # no event is requested, because a hang-up is always reported
    terminal.register(descriptor, 0)
    return any(event & (select.POLLHUP | select.POLLERR) for _, event in terminal.poll())


# --- output and shell commands

_PLAIN_WORD = r"[A-Za-z0-9_./\\:=+-]+"  # words that cmd.exe and PowerShell accept without quotes
_DEVICE = r"(?i:con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])( *\..*)?"  # device names of Windows


def command_line(words: Sequence[str]) -> str:
    """Return a command in the syntax of this system's shell; on Windows, of both cmd.exe and PowerShell."""
    if sys.platform == "win32":
        return windows_command_line(words)
    from shlex import join

    return join(words)


def windows_command_line(words: Sequence[str]) -> str:
    """Return a command for both cmd.exe and PowerShell, with special characters in double quotes.

    A double quote within a word is written in the syntax of cmd.exe only; % and $ with a variable name are expanded.
    """
    import re
    from subprocess import list2cmdline

    written = []
    for word in words:
        quoted = list2cmdline([word])
        # list2cmdline quotes only for C programs, not for the shell
        if quoted == word and not re.fullmatch(_PLAIN_WORD, word):
            backslashes = word[len(word.rstrip("\\")) :]  # trailing backslashes are doubled before a quote
            quoted = f'"{word}{backslashes}"'
        written.append(quoted)
    return " ".join(written)


def command_quote() -> str:
    """Return the quote with which `command_line` encloses words with spaces."""
    return '"' if sys.platform == "win32" else "'"


@cache
def broken_line_end() -> str:
    """Return the line-continuation character of the calling shell, or an empty text for an unknown shell."""
    if sys.platform != "win32":
        return " \\"
    from shellingham import ShellDetectionFailure, detect_shell

    try:
        shell, _ = detect_shell()
    except (ShellDetectionFailure, OSError):
        return ""
    return {"cmd": " ^", "powershell": " `", "pwsh": " `", "bash": " \\"}.get(shell, "")


def why_not_a_file(path: str) -> str:
    """Return the reason why this system does not allow a file of this name, or an empty text."""
    return why_not_a_windows_file(path) if sys.platform == "win32" else ""


def why_not_a_windows_file(path: str) -> str:
    """Return the reason why Windows does not allow a file of this name, or an empty text."""
    import re
    from pathlib import PureWindowsPath

    named = PureWindowsPath(path)
    # the colon of a drive letter is allowed
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
    """Return whether the terminal of a stream accepts control codes, after enabling them in a Windows console."""
    if sys.platform == "win32":
        import ctypes
        import msvcrt

        with suppress(OSError, ValueError):  # the stream has no descriptor
            mode = ctypes.c_ulong()
            console = ctypes.windll.kernel32
            handle = ctypes.c_void_p(msvcrt.get_osfhandle(stream.fileno()))
            # fails if the stream is not a console
            if console.GetConsoleMode(handle, ctypes.byref(mode)):
                return bool(console.SetConsoleMode(handle, mode.value | 4))  # 4: virtual terminal processing
        return False
    return True


def output_encoding(stream: Any) -> str:
    """Return the encoding of results for programs and files.

    stream: text stream whose encoding is used. On Windows it is a code page without most letters, so results are UTF-8,
        as in the files that we write.
    """
    return "utf-8" if sys.platform == "win32" else stream.encoding or "utf-8"


def pipe_stream(stream: TextIO) -> TextIO:
    """Return a stream that raises BrokenPipeError when its reader is gone; Windows raises another error by default."""
    if sys.platform != "win32" or stream.isatty():
        return stream
    try:
        raw = _PipeWriter(stream.fileno(), "wb", closefd=False)
    except (OSError, ValueError):  # the stream has no descriptor
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
    """A writable file or pipe on Windows."""

    def write(self, data: Any) -> int:
        """Write bytes.

        Raises BrokenPipeError if the reader of the pipe is gone, OSError for any other fault.
        """
        try:
            return super().write(data)
        except OSError as error:
            if error.errno == errno.EINVAL:
                raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE)) from None
            raise
