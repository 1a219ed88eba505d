"""Make figures, reports, answers and verdicts again from the files below them, and write
the SHA-256 of what comes out.

The jobs run in a folder of their own, which links to all other files of the run.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

from job import Job, run

from elastocal.io.json_files import write_json
from elastocal.io.origin import Origin
from elastocal.io.records import (
    compute_sha256,
    list_recorded_files,
    list_recorded_outputs,
    locate_record,
    read_record,
)


def remake_files(job: Job) -> None:
    settings = job.params
    pattern = re.compile("|".join(settings.remade))
    # The files of each output, which may be a folder.
    by_origin: dict[Origin, dict[str, list[str]]] = {}
    for output in filter(pattern.fullmatch, list_recorded_outputs()):
        made_by, files = read_record(output)
        by_origin.setdefault(made_by.origin, {})[output] = [*files]
    digests: dict[str, str] = {}
    for origin, outputs in by_origin.items():
        # Figures and reports state the commit that they are from.
        configuration = settings.configuration | {"origin": vars(origin)}
        digests |= _remake_outputs_of_origin(outputs, configuration, settings.snakefile)
    write_json(job.output.digests, digests)


def _remake_outputs_of_origin(
    outputs: dict[str, list[str]], configuration: dict[str, object], snakefile: str
) -> dict[str, str]:
    """Make outputs of one commit again; return the SHA-256 of each of their files, empty
    for a file that cannot be made, which the audit reports."""
    files = [*chain.from_iterable(outputs.values())]
    with tempfile.TemporaryDirectory(dir=".snakemake", prefix="remade_") as name:
        folder = Path(name).resolve()
        _link_files(folder, {*files, *_list_records(outputs)})
        config_file = folder / "configuration.json"
        write_json(config_file, configuration)
        command = [sys.executable, "-m", "snakemake", "-j1", "--keep-going"]
        command += ["--snakefile", snakefile, "--directory", str(folder)]
        # A change of the code alone makes no file again; `make paper` did that before.
        command += ["--configfile", str(config_file), "--rerun-triggers", "mtime"]
        command += ["--quiet", "all", "--", *outputs]
        made = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if made.returncode:
            print(made.stderr, file=sys.stderr)
        return {
            file: compute_sha256(folder / file) if (folder / file).is_file() else ""
            for file in files
        }


def _list_records(outputs: Iterable[str]) -> list[str]:
    return [locate_record(output).as_posix() for output in outputs]


def _link_files(folder: Path, remade: set[str]) -> None:
    """Link to all recorded files and their records but those that are made again."""
    records = _list_records(list_recorded_outputs())
    for file in {*list_recorded_files(), *records} - remade:
        if Path(file).is_file():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            os.link(file, folder / file)


# The audit reports altered files; a job that checks its inputs would refuse them.
run(remake_files, snakemake, check_inputs=False)
