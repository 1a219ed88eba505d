"""Table 1: the compliances that the study takes as true."""

from job import Job, run

from elastocal.io.data_frames import write_csv
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.tables import table1


def tabulate_compliances(job: Job) -> None:
    write_csv(job.output.table, table1({name: robot_from_document(d, name) for name, d in job.params.robots.items()}))


run(tabulate_compliances, snakemake)
