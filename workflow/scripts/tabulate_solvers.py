"""How far the estimates of strategies and solvers that should agree are apart."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.table_schemas import solvers
from elastocal.study.tables import solver_summary


def tabulate_solvers(job: Job) -> None:
    settings = zip(job.params.robots, job.params.joints, job.input.solvers, strict=True)
    write_csv(job.output.table, solver_summary({robot: read_frame(path, solvers(n)) for robot, n, path in settings}))


run(tabulate_solvers, snakemake)
