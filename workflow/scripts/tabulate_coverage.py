"""How often stated accuracies hold: all cases, and their coverage with intervals."""

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import write_csv
from elastocal_proof.blind.stated_accuracy import coverage


def tabulate_coverage(job: Job) -> None:
    rows = pd.concat([pd.read_csv(path) for path in job.input.stated], ignore_index=True)
    write_csv(job.output.cases, rows)
    write_csv(job.output.coverage, coverage(rows))


run(tabulate_coverage, snakemake)
