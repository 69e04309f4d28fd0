"""What may not happen while an input is read, whatever is in it: other files written, programs started, connections made; more
than 2 s of processor time, or 500 MB of memory."""

from __future__ import annotations

import os
import re
import resource
import signal
import sys
from collections.abc import Callable
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from io import StringIO

from runner.machine import peak_memory

LONGEST = 2  # s of processor time that an input may take
MOST_MEMORY = 500_000  # kB, with that of Python and its libraries, which is ...
LIBRARIES = 200_000  # ... some 150 MB; among other tests there may be more before the first input

OWN = re.compile(r"[xt]\.[a-z.]+")  # files that the targets write themselves
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
FORBIDDEN = {
    "os.rename", "os.mkdir", "os.rmdir", "os.symlink", "os.link", "os.chmod", "os.chown", "os.truncate", "os.utime", "os.system",
    "os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "os.kill", "os.putenv", "os.chdir", "subprocess.Popen",
    "socket.connect", "socket.bind", "socket.getaddrinfo", "ctypes.dlopen", "shutil.rmtree", "shutil.move", "shutil.copyfile",
    "tempfile.mkstemp", "tempfile.mkdtemp", "urllib.Request", "webbrowser.open", "pickle.find_class",
}  # fmt: skip

_done: list[str] | None = None  # while an input is read, what it does that it must not


def _hook(event: str, arguments: tuple) -> None:
    if _done is None:
        return
    if event == "open":
        path, _, flags = arguments
        if flags & WRITING and not OWN.fullmatch(os.fspath(path) if isinstance(path, (str, os.PathLike)) else str(path)):
            _done.append(f"wrote {path}")
    elif event in FORBIDDEN:
        _done.append(f"{event} {arguments}")


sys.addaudithook(_hook)


@dataclass
class Watched:
    """`target`, which fails where an input makes it do what it must not; keeps count of what it took."""

    target: Callable[[bytes], None]
    seconds: float = LONGEST
    inputs: int = 0
    most: int = field(default_factory=lambda: max(MOST_MEMORY, memory() + MOST_MEMORY - LIBRARIES))
    longest: float = 0.0  # s of processor time
    slowest: bytes = b""

    def __call__(self, data: bytes) -> None:
        global _done
        signal.signal(signal.SIGVTALRM, _late)
        before, _done, said = _used(), [], StringIO()
        signal.setitimer(signal.ITIMER_VIRTUAL, self.seconds)
        try:
            with redirect_stderr(said):  # where a library's own log goes, too, as nobody handles it
                self.target(data)
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            done, _done = _done, None
        assert not done, done
        assert not said.getvalue(), said.getvalue()
        used = _used() - before
        self.inputs += 1
        if used > self.longest:
            self.longest, self.slowest = used, data
        assert memory() <= self.most, f"{memory():,} kB"


def memory() -> int:
    """The most that this process has had so far, in kB: getrusage would count what its parent had, too."""
    return peak_memory() // 1024


def _late(*_) -> None:
    raise TimeoutError("takes too long")


def _used() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime
