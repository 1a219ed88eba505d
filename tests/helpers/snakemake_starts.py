"""Starts of Snakemake that share its imports, half of a start: a process that has made
them forks for each."""

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

# What the plug-ins and the rules import of other people; nothing of elastocal, of which
# each folder has its own.
SHARED = (
    "grimp",
    "jsonschema",
    "pandas",
    "pyarrow.parquet",
    "scipy.stats",
    "snakemake_executor_plugin_slurm",
    "typst",
    "yaml",
)


@cache
def _server():
    """One for each process of the tests."""
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
    """`subprocess.run` of `python -m snakemake ...`, with its output as text."""
    assert args[:3] == [sys.executable, "-m", "snakemake"]
    with tempfile.TemporaryDirectory() as folder:
        texts = [Path(folder) / name for name in ("stdout", "stderr")]
        for path in texts:
            path.touch()
        asked = {
            "arguments": list(map(str, args[3:])),
            "folder": str(cwd),
            "environment": env,
            "texts": list(map(str, texts)),
        }
        print(json.dumps(asked), file=_server().stdin, flush=True)
        if not select.select([_server().stdout], [], [], HUNG_S)[0]:
            raise subprocess.TimeoutExpired(args, HUNG_S)
        return subprocess.CompletedProcess(
            args,
            int(_server().stdout.readline()),
            *(path.read_text("utf-8") for path in texts),
        )


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
        sys.path[0:1] = [
            asked["folder"],
            *asked["environment"]["PYTHONPATH"].split(os.pathsep),
        ]
        for number, path in enumerate((os.devnull, *asked["texts"])):
            os.dup2(os.open(path, os.O_RDWR), number)
        sys.argv = ["snakemake", *asked["arguments"]]
        snakemake.cli.main()


if __name__ == "__main__":
    _serve()
