"""Starts Snakemake in forks of a process that has already imported it, because the
imports take half of a start."""

import atexit
import gc
import json
import os
import select
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

from durations import HUNG_S

# Modules that the plug-ins and the rules import. elastocal is not one of them, because
# each folder has its own copy.
SHARED = (
    "PIL.Image",
    "grimp",
    "jsonschema",
    "nbformat.validator",
    "pandas",
    "pyarrow.parquet",
    "scipy.optimize",
    "scipy.stats",
    "smart_open",
    "snakemake.benchmark",
    "snakemake.profiles",
    "snakemake.report.html_reporter",
    "snakemake.storage",
    "snakemake_executor_plugin_slurm",
    "typst",
    "yaml",
)


@cache
def _server():
    """Start the server; each process of the tests has its own."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    server = subprocess.Popen(
        [sys.executable, __file__],
        **pipes,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    atexit.register(server.communicate)
    return server


def started(args, cwd, env):
    """Run `python -m snakemake ...` like `subprocess.run`, with its output as text."""
    assert args[:3] == [sys.executable, "-m", "snakemake"]
    with tempfile.TemporaryDirectory() as folder:
        texts = [Path(folder) / name for name in ("stdout", "stderr")]
        for path in texts:
            path.touch()
        request = {
            "arguments": list(map(str, args[3:])),
            "folder": str(cwd),
            "environment": env,
            "texts": list(map(str, texts)),
        }
        print(json.dumps(request), file=_server().stdin, flush=True)
        if not select.select([_server().stdout], [], [], HUNG_S)[0]:
            raise subprocess.TimeoutExpired(args, HUNG_S)
        return subprocess.CompletedProcess(
            args,
            int(_server().stdout.readline()),
            *(path.read_text("utf-8") for path in texts),
        )


def _serve():
    """Run Snakemake in a fork for each request on standard input, and answer with its
    exit code."""
    import snakemake.cli

    for name in SHARED:
        __import__(name)
    gc.freeze()
    for line in sys.stdin:
        request = json.loads(line)
        if child := os.fork():
            print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
            continue
        os.chdir(request["folder"])
        os.environ.clear()
        os.environ.update(request["environment"])
        sys.path[0:1] = [
            request["folder"],
            *request["environment"]["PYTHONPATH"].split(os.pathsep),
        ]
        for number, path in enumerate((os.devnull, *request["texts"])):
            os.dup2(os.open(path, os.O_RDWR), number)
        sys.argv = ["snakemake", *request["arguments"]]
        snakemake.cli.main()


if __name__ == "__main__":
    _serve()
