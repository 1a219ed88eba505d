"""Make figures, reports, answers and verdicts again from the files below them, and write
the SHA-256 of what comes out.

The jobs run in a folder of their own, which links to all other files of the run.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from job import Job, run

from elastocal.io.json_files import write_json
from elastocal.io.origin import Origin
from elastocal.io.records import (
    RECORDS,
    compute_sha256,
    list_recorded_files,
    locate_record,
    read_record,
)


def remake_files(job: Job) -> None:
    settings = job.params
    pattern = re.compile("|".join(settings.remade))
    by_origin: dict[Origin, list[str]] = {}
    for file in filter(pattern.fullmatch, list_recorded_files()):
        by_origin.setdefault(read_record(file)[0].origin, []).append(file)
    digests: dict[str, str] = {}
    for origin, files in by_origin.items():
        # Figures and reports state the commit that they are from.
        configuration = settings.configuration | {"origin": vars(origin)}
        digests |= _remake_files_of_origin(files, configuration, settings.snakefile)
    write_json(job.output.digests, digests)


def _remake_files_of_origin(
    files: list[str], configuration: dict[str, object], snakefile: str
) -> dict[str, str]:
    """Make files of one commit again; return the SHA-256 of each, empty for a file that
    cannot be made, which the audit reports."""
    with tempfile.TemporaryDirectory(dir=".snakemake", prefix="remade_") as name:
        folder = Path(name).resolve()
        _link_files(folder, files)
        config_file = folder / "configuration.json"
        write_json(config_file, configuration)
        command = [sys.executable, "-m", "snakemake", "-j1", "--keep-going"]
        command += ["--snakefile", snakefile, "--directory", str(folder)]
        # A change of the code alone makes no file again; `make paper` did that before.
        command += ["--configfile", str(config_file), "--rerun-triggers", "mtime"]
        command += ["--quiet", "all", "--", *files]
        made = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if made.returncode:
            print(made.stderr, file=sys.stderr)
        return {
            file: compute_sha256(folder / file) if (folder / file).is_file() else ""
            for file in files
        }


def _link_files(folder: Path, remade: list[str]) -> None:
    """Link to all recorded files and their records but those that are made again."""
    left_out = {*remade, *(locate_record(file).as_posix() for file in remade)}
    records = [path.as_posix() for path in RECORDS.rglob("*.json")]
    for file in {*list_recorded_files(), *records} - left_out:
        if Path(file).is_file():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            os.link(file, folder / file)


# The audit reports altered files; a job that checks its inputs would refuse them.
run(remake_files, snakemake, check_inputs=False)
