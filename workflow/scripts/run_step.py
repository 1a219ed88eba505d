"""Call the function of the packages that a rule names as its `step`, with the job."""

from importlib import import_module

from job import Job, run


def run_step(job: Job) -> None:
    module, _, name = job.params.step.rpartition(".")
    getattr(import_module(module), name)(job)


# Files of a user have no record of a job; the rule has their digest instead.
run(
    run_step,
    snakemake,
    check_inputs=not snakemake.params.get("files_sha256"),
)
