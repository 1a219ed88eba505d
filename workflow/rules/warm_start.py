"""Start jobs as copies of one process that has already imported the libraries.

Importing the libraries takes most jobs longer than their own work. A server process
imports them once; for each job it forks a copy of itself, which runs the job's script.
The copy imports the modules of this project itself, so a job always runs the code that
is on disk.
"""

import atexit
import gc
import os
import selectors
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

# Libraries that jobs import, those of the first jobs first. The server imports one of
# them whenever no job is waiting to be started.
LIBRARIES = [
    "snakemake.io",
    "snakemake.logging",
    "numpy",
    "pyarrow.parquet",
    "pandas",
    "scipy.linalg",
    "scipy.special",
    "scipy.optimize",
    "scipy.spatial.transform",
    "jsonschema",
    "matplotlib.figure",
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_pdf",
    "pandas.io.formats.style",
    "sklearn.gaussian_process",
    "sklearn.tree",
]
# Each job has one core. With these thresholds glibc keeps the memory of a large array
# for the next one: fresh pages cost a fifth of the time of a job.
SETTINGS = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMEXPR_NUM_THREADS": "1",
    "GLIBC_TUNABLES": (
        f"glibc.malloc.mmap_threshold={2**30}:glibc.malloc.trim_threshold={2**32}"
    ),
}
# Size of an answer of the server: a number in decimal digits.
ANSWER_BYTES = 8
# Answer of the server if the system refuses it another process.
REFUSED = -1


@dataclass(frozen=True)
class StartedScript:
    """A script that runs in a process of its own.

    Attributes
    ----------
    process : int
        Number of the process; 0 if the server was killed.
    wait : callable
        Waits for the end of the process and returns its exit code.
    """

    process: int
    wait: Callable[[], int]


def start_server() -> Callable[[str], StartedScript] | None:
    """Start the server.

    Returns
    -------
    callable or None
        A function that starts a script by its file name, and raises `OSError` if the
        system refuses another process. None if the system refuses what the server
        needs, as old kernels and sandboxes do; jobs are then started the plain way.
    """
    try:
        os.close(os.pidfd_open(os.getpid()))
    except (AttributeError, OSError):
        return None
    requests, server_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    command = [sys.executable, "-P", __file__, str(server_end.fileno())]
    try:
        server = subprocess.Popen(
            command, env=os.environ | SETTINGS, pass_fds=[server_end.fileno()]
        )
    except OSError:
        requests.close()
        return None
    finally:
        server_end.close()
    # Handlers run in reverse order: the server ends when the socket is closed.
    atexit.register(server.wait)
    atexit.register(requests.close)

    def start_script(script: str) -> StartedScript:
        read_end, write_end = os.pipe()
        socket.send_fds(requests, [os.fsencode(script)], [write_end])
        os.close(write_end)
        # A killed server leaves the pipe empty. The script may have begun by then, so
        # it counts as killed and is not started again.
        process = _read_answer(read_end, 0)
        if process == REFUSED:
            os.close(read_end)
            raise ChildProcessError("the system refused another process")

        def wait() -> int:
            exit_code = _read_answer(read_end, -signal.SIGKILL)
            os.close(read_end)
            return exit_code

        return StartedScript(process, wait)

    return start_script


def serve(requests: socket.socket) -> str:
    """Fork a process for each requested script until no more requests can come.

    A request is the file name of a script and the write end of a pipe. Over the pipe
    the server answers with the number of the process and, once that has ended, with its
    exit code.

    Returns
    -------
    str
        The script to run; the function returns in the forked processes alone.
    """
    # An interrupt of the run reaches the jobs too, which end by themselves.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    libraries = [*LIBRARIES]
    with selectors.DefaultSelector() as selector:
        selector.register(requests, selectors.EVENT_READ)
        while selector.get_map():
            events = selector.select(0 if libraries else None)
            if not events:
                _import_library(libraries.pop(0))
            for key, _ in events:
                if key.fileobj is not requests:
                    _report_end(selector.unregister(key.fd))
                    continue
                message, pipes, *_ = socket.recv_fds(requests, 4096, 1)
                if not message:
                    libraries.clear()
                    selector.unregister(requests)
                elif _fork_for_script(selector, pipes[0]) == 0:
                    requests.close()
                    signal.signal(signal.SIGINT, signal.default_int_handler)
                    return os.fsdecode(message)
    sys.exit()


def _import_library(name: str) -> None:
    # A job that needs a library that cannot be imported reports it itself.
    with suppress(Exception):
        import_module(name)
    # Garbage collection of these objects would copy their pages in each job.
    gc.freeze()


def _fork_for_script(selector: selectors.BaseSelector, pipe: int) -> int:
    """Fork, and return the number of the process, or 0 in the forked process."""
    try:
        process = os.fork()
    except OSError:
        _answer(pipe, REFUSED)
        os.close(pipe)
        return REFUSED
    if process:
        _answer(pipe, process)
        end_of_process = os.pidfd_open(process)
        selector.register(end_of_process, selectors.EVENT_READ, (process, pipe))
    return process


def _report_end(key: selectors.SelectorKey) -> None:
    process, pipe = key.data
    _, status = os.waitpid(process, 0)
    _answer(pipe, os.waitstatus_to_exitcode(status))
    os.close(pipe)
    os.close(key.fd)


def _answer(pipe: int, number: int) -> None:
    # After a run was killed nobody reads the answer.
    with suppress(BrokenPipeError):
        os.write(pipe, f"{number:{ANSWER_BYTES}d}".encode())


def _read_answer(pipe: int, default: int) -> int:
    answer = os.read(pipe, ANSWER_BYTES)
    return int(answer) if answer else default


if __name__ == "__main__":
    SCRIPT = serve(socket.socket(fileno=int(sys.argv[1])))
    exec(compile(Path(SCRIPT).read_bytes(), SCRIPT, "exec"))
    # Leave without the interpreter's cleanup, which would copy the shared pages.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)
