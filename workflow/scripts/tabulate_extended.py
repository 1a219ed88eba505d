"""What calibration with the reduced model leaves of robots with elastic links."""

from job import Job, run

from elastocal.io.data_frames import read_long, write_csv
from elastocal.study.table_schemas import REPLICATES, metrics
from elastocal.study.tables import extended_table


def tabulate_extended(job: Job) -> None:
    settings = job.params
    table = extended_table(
        read_long(job.input.metrics, metrics),
        read_long(job.input.replicates, lambda joints: REPLICATES),
        settings.robots,
        settings.strategies,
        settings.noise_um,
        settings.length,
    )
    write_csv(job.output.table, table)


run(tabulate_extended, snakemake)
