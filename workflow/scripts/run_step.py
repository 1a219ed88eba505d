"""The script of every rule that names a `step`, a function of the packages: calls it
with the job."""

from importlib import import_module

from job import Job, run


def run_step(job: Job) -> None:
    module, _, name = job.params.step.rpartition(".")
    getattr(import_module(module), name)(job)


# Of a user's own files, which come with their digest, there is no record.
run(
    run_step,
    snakemake,
    snakemake.input.sources if snakemake.params.get("files_sha256") else None,
)
