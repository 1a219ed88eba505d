"""What jobs read and no job made as a file by itself: sources, configuration, files in folders; and digests of all files."""

import zipfile
from pathlib import Path

from job import Job, run

from elastocal.errors import InputError
from elastocal.io.atomic_writes import atomic_write
from elastocal.io.origin import canonical_json
from elastocal.io.records import checksum, files_of, jobs_behind


def pack_sources(job: Job) -> None:
    jobs = jobs_behind(job.input.files)
    outputs = {output for each in jobs for output in each.outputs}
    read = {file for each in jobs for file in each.inputs.keys() - each.made_inputs.keys()}
    packed = read.union(job.input.workflow, *(files_of(output) for output in outputs if Path(output).is_dir()))
    if outside := next((name for name in sorted(packed) if Path(name).is_absolute() or ".." in Path(name).parts), None):
        raise InputError(outside, "", "a file outside of the folder of the results", "sources in it: a checkout")
    texts = {"configuration.json": canonical_json(job.params.configuration)}
    described = sorted(packed | {output for output in outputs if Path(output).is_file()})
    texts["SHA256SUMS"] = "".join(f"{checksum(name)}  {name}\n" for name in described)
    with atomic_write(job.output.archive) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in [*texts.items(), *((name, Path(name).read_bytes()) for name in sorted(packed))]:
            # Without the file's own date: the same files make the same archive.
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)


run(pack_sources, snakemake)
