"""Sources and configuration that a crate describes, and what checks it, as one archive; no job made them."""

import zipfile
from pathlib import Path
from urllib.parse import unquote

from job import Job, run

from elastocal.io.atomic_writes import atomic_write
from elastocal.io.json_files import read_json

MADE = ("data/", "results/", "reports/")


def pack_sources(job: Job) -> None:
    graph = read_json(job.input.crate)["@graph"]
    described = {unquote(entity["@id"]) for entity in graph if "sha256" in entity}
    with atomic_write(job.output.archive) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted({job.input.check, *(name for name in described if not name.startswith(MADE))}):
            # Without the file's own date: the same files make the same archive.
            archive.writestr(zipfile.ZipInfo(name), Path(name).read_bytes(), zipfile.ZIP_DEFLATED)


run(pack_sources, snakemake)
