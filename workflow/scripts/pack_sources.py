"""What a crate describes and no job made as a file by itself, with what checks it: sources, configuration, files in folders."""

import hashlib
import zipfile
from pathlib import Path
from urllib.parse import unquote

from job import Job, run

from elastocal.errors import InputError
from elastocal.io.atomic_writes import atomic_write
from elastocal.io.json_files import read_json

MADE = ("data/", "results/", "reports/")


def pack_sources(job: Job) -> None:
    graph = read_json(job.input.crate)["@graph"]
    described = {unquote(entity["@id"]): entity["sha256"] for entity in graph if "sha256" in entity}
    folders = tuple(unquote(entity["@id"]) for entity in graph if entity["@type"] == "Dataset" and entity["@id"] != "./")
    packed = {name for name in described if name.startswith(folders) or not name.startswith(MADE)}
    with atomic_write(job.output.archive) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted({job.input.check, *packed}):
            content = Path(name).read_bytes()
            if name in packed and hashlib.sha256(content).hexdigest() != described[name]:
                raise InputError(name, "", "other contents than the crate describes", "the file as it was described")
            # Without the file's own date: the same files make the same archive.
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)


run(pack_sources, snakemake)
