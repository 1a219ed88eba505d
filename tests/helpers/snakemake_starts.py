"""Starts of Snakemake and of its scripts that share their imports, half of a start: what has made them forks for each."""

import atexit
import gc
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import types
from functools import cache
from pathlib import Path

from durations import HUNG_S

# What the plug-ins, the rules and the scripts import of other people; nothing of elastocal, of which each folder has its own.
SHARED = (
    *("grimp", "jsonschema", "matplotlib.backends.backend_agg", "matplotlib.backends.backend_pdf", "matplotlib.figure"),
    *("mujoco", "pandas", "pyarrow.parquet", "scipy.interpolate", "scipy.optimize", "scipy.sparse.csgraph", "scipy.spatial"),
    *("scipy.stats", "snakemake_executor_plugin_slurm", "snakemake_storage_plugin_s3", "statsmodels.api", "typst", "yaml"),
)


@cache
def _server():
    """One for each process of the tests."""
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    server = subprocess.Popen([sys.executable, __file__], **pipes, text=True, env=environment)
    atexit.register(server.communicate)
    return server


def started(args, cwd, env):
    """`subprocess.run` of `python -m snakemake ...`, with its output as text."""
    assert args[:3] == [sys.executable, "-m", "snakemake"]
    with tempfile.TemporaryDirectory() as folder:
        texts = [Path(folder) / name for name in ("stdout", "stderr")]
        for path in texts:
            path.touch()
        asked = {"arguments": list(map(str, args[3:])), "folder": str(cwd), "environment": env, "texts": list(map(str, texts))}
        print(json.dumps(asked), file=_server().stdin, flush=True)
        if not select.select([_server().stdout], [], [], HUNG_S)[0]:
            raise subprocess.TimeoutExpired(args, HUNG_S)
        return subprocess.CompletedProcess(args, int(_server().stdout.readline()), *(path.read_text("utf-8") for path in texts))


def _serve():
    import snakemake.cli

    for name in SHARED:
        __import__(name)
    gc.freeze()
    for line in sys.stdin:
        asked = json.loads(line)
        if child := os.fork():
            print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
            continue
        os.chdir(asked["folder"])
        os.environ.clear()
        os.environ.update(asked["environment"])
        sys.path[0:1] = [asked["folder"], *asked["environment"]["PYTHONPATH"].split(os.pathsep)]
        for number, path in enumerate((os.devnull, *asked["texts"])):
            os.dup2(os.open(path, os.O_RDWR), number)
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        if os.fork():
            theirs.close()
            _fork_scripts(ours)
            sys.argv = ["snakemake", *asked["arguments"]]
            snakemake.cli.main()
        ours.close()
        _run_asked(theirs)


def _fork_scripts(jobs):
    """Have each script of this Snakemake run by a process that is forked for it, as long as Snakemake lives."""
    from snakemake.benchmark import benchmarked
    from snakemake.script import PythonScript

    def execute_script(script, name, edit=False):
        answers, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        socket.send_fds(jobs, [name.encode()], [its.fileno()])
        its.close()
        with benchmarked(int(answers.recv(64)), script.bench_record):
            ended = int(answers.recv(64))
        answers.close()
        if ended:
            raise subprocess.CalledProcessError(ended, name)

    PythonScript.execute_script = execute_script


def _run_asked(jobs):
    """In a process for each, run the scripts that are asked for; one beside it waits for its end."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while (asked := socket.recv_fds(jobs, 4096, 1))[0]:
        if os.fork():
            os.close(asked[1][0])
            continue
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        answers, script = socket.socket(fileno=asked[1][0]), asked[0].decode()
        if job := os.fork():
            answers.send(str(job).encode())
            answers.send(str(os.waitstatus_to_exitcode(os.waitpid(job, 0)[1])).encode())
            break
        sys.argv, sys.path[0] = [script], os.path.dirname(script)
        sys.modules["__main__"] = main = types.ModuleType("__main__")
        main.__file__ = script
        exec(compile(Path(script).read_bytes(), script, "exec"), vars(main))
        sys.exit()
    os._exit(0)


if __name__ == "__main__":
    _serve()
