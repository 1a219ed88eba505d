"""Jobs begin as copies of one process that has imported the libraries, which took most
jobs longer than their own work.

What is of this project, the workflow and the package, each job imports by itself, as it
is on the disk by then.
"""

import atexit
import gc
import os
import selectors
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path

# What jobs import, that of the first ones first; one after the other, while no job asks
# to begin.
LIBRARIES = (
    *(
        "snakemake.io",
        "snakemake.logging",
        "numpy",
        "pyarrow.parquet",
        "pandas",
        "scipy.linalg",
        "scipy.special",
    ),
    *(
        "scipy.optimize",
        "scipy.spatial.transform",
        "jsonschema",
        "matplotlib.figure",
        "matplotlib.backends.backend_agg",
    ),
    *(
        "matplotlib.backends.backend_pdf",
        "pandas.io.formats.style",
        "sklearn.gaussian_process",
        "sklearn.tree",
    ),
)
# A job has one core. What a large array leaves free is for the next one: new pages took
# a fifth of the time of a job.
SETTINGS = {
    f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMEXPR")
}
SETTINGS |= {
    "GLIBC_TUNABLES": f"glibc.malloc.mmap_threshold={2**30}:glibc.malloc.trim_threshold={2**32}"
}


def start_warm() -> None:
    """From now on scripts of rules begin that way: each in a process of its own, with
    its log and its times, as without."""
    from snakemake.benchmark import benchmarked
    from snakemake.script import PythonScript

    requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    command = [sys.executable, "-P", __file__, str(theirs.fileno())]
    server = subprocess.Popen(
        command, env=os.environ | SETTINGS, pass_fds=[theirs.fileno()]
    )
    theirs.close()
    # The last one first.
    atexit.register(server.wait)
    atexit.register(requests.close)

    def execute_script(script, name, edit=False):
        read, write = os.pipe()
        socket.send_fds(requests, [os.fsencode(name)], [write])
        os.close(write)
        # Where the server was killed there is nothing to read.
        with (
            open(read, "rb", buffering=0) as news,
            benchmarked(int(news.read(8) or 0) or False, script.bench_record),
        ):
            code = int(news.read(8) or -signal.SIGKILL)
        if code:
            raise subprocess.CalledProcessError(code, name)

    PythonScript.execute_script = execute_script


def serve(requests: socket.socket) -> str:
    """Begin a process for each script that is asked for, until nobody can ask any more;
    returns in these, with the script.

    Who asks hands over a pipe, and reads from it the number of the process and, once
    that has ended, its exit code.
    """
    # Jobs of an interrupted run have the interrupt too, and end by themselves.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    left = [*LIBRARIES]
    with selectors.DefaultSelector() as waiting:
        waiting.register(requests, selectors.EVENT_READ)
        while waiting.get_map():
            events = waiting.select(0 if left else None)
            if not events:
                # A job that needs what cannot be imported says so.
                with suppress(Exception):
                    import_module(left.pop(0))
                # To look through it for garbage would copy it in each job.
                gc.freeze()
            for key, _ in events:
                if key.fileobj is requests:
                    script, pipes, *_ = socket.recv_fds(requests, 4096, 1)
                    if not script:
                        left.clear()
                        waiting.unregister(requests)
                    elif pid := os.fork():
                        _tell(*pipes, pid)
                        waiting.register(
                            os.pidfd_open(pid), selectors.EVENT_READ, (pid, *pipes)
                        )
                    else:
                        requests.close()
                        signal.signal(signal.SIGINT, signal.default_int_handler)
                        return os.fsdecode(script)
                else:
                    pid, pipe = waiting.unregister(key.fd).data
                    _tell(pipe, os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
                    os.close(pipe)
                    os.close(key.fd)
    sys.exit()


def _tell(pipe: int, number: int) -> None:
    # Of a run that was killed nobody reads it.
    with suppress(BrokenPipeError):
        os.write(pipe, f"{number:8d}".encode())


if __name__ == "__main__":
    SCRIPT = serve(socket.socket(fileno=int(sys.argv[1])))
    exec(compile(Path(SCRIPT).read_bytes(), SCRIPT, "exec"))
    # Without taking the libraries apart, which would copy them.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)
