"""Table 4 over studies, by what is measured and averaged, and the joint test of the printed figures."""

from pathlib import Path

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import read_studies, write_csv
from elastocal.study.joint_test import joint_table
from elastocal.study.study_tables import measured_table
from elastocal.study.table_schemas import repeated
from elastocal.study.tables import add_slugs


def tabulate_studies(job: Job) -> None:
    settings = job.params
    reference = pd.read_csv(job.input.reference, dtype={"table": str}, keep_default_na=False)
    studies = {
        name: read_studies([path for path in job.input.studies if Path(path).parent.name == name], repeated)
        for name in settings.measured
    }
    by_kind = {settings.measured[name]: frame for name, frame in studies.items()}
    write_csv(job.output.table, add_slugs(measured_table(by_kind, settings.length, settings.limits), settings.slugs))
    write_csv(job.output.joint, joint_table(studies[settings.usual], reference, settings.length))


run(tabulate_studies, snakemake)
