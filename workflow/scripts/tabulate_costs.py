"""What an accuracy costs by each set of points, and where one begins to pay."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.bootstrap import bootstrap_weights
from elastocal.study.costs import break_even_table, cost_table
from elastocal.study.table_schemas import BUDGET


def tabulate_costs(job: Job) -> None:
    settings, drawn = job.params, job.params.weights
    frames = {robot: read_frame(path, BUDGET) for robot, path in zip(settings.robots, job.input.budgets, strict=True)}
    weights = {
        robot: bootstrap_weights(drawn["seed"], robot, sorted(set(frame.data_set)), drawn["replicates"])
        for robot, frame in frames.items()
    }
    write_csv(job.output.costs, cost_table(frames, settings.point_sets, settings.accuracies_um[0], weights))
    write_csv(job.output.break_even, break_even_table(frames, settings.point_sets, settings.accuracies_um, weights))


run(tabulate_costs, snakemake)
