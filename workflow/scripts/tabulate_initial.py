"""Table 2: deviation before calibration."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.bootstrap import bootstrap_weights
from elastocal.study.table_schemas import INITIAL
from elastocal.study.tables import table2


def tabulate_initial(job: Job) -> None:
    settings = job.params
    initial = {robot: read_frame(path, INITIAL) for robot, path in zip(settings.robots, job.input.initial, strict=True)}
    weights = {
        robot: bootstrap_weights(settings.seed, robot, frame.data_set, settings.replicates) for robot, frame in initial.items()
    }
    write_csv(job.output.table, table2(initial, weights))


run(tabulate_initial, snakemake)
