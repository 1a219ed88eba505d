"""What each interpretation of the paper's open points moves."""

from pathlib import Path

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import read_studies, write_csv
from elastocal.study.study_tables import interpretations_table
from elastocal.study.table_schemas import repeated


def tabulate_interpretations(job: Job) -> None:
    settings = job.params
    reference = pd.read_csv(job.input.reference, dtype={"table": str}, keep_default_na=False)
    names = list(dict.fromkeys(Path(path).parent.name for path in job.input.studies))
    files = {name: [path for path in job.input.studies if Path(path).parent.name == name] for name in names}
    studies = {name: read_studies(paths, repeated) for name, paths in files.items()}
    write_csv(job.output.table, interpretations_table(studies, reference, settings.length, settings.usual, settings.classical))


run(tabulate_interpretations, snakemake)
