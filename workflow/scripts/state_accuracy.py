"""What is stated of the accuracy of each robot of the closed loop, beside the truth."""

from pathlib import Path

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import write_csv
from elastocal_proof.blind.closed_loop import cases
from elastocal_proof.blind.stated_accuracy import stated_accuracy


def state_accuracy(job: Job) -> None:
    robot = Path(job.input.robot)
    rows = [
        row
        for case in cases(str(robot), job.params.seed, job.params.each)
        for row in stated_accuracy(str(robot), str(robot.parent), *case, job.wildcards.frame)
    ]
    write_csv(job.output.stated, pd.DataFrame(rows))


run(state_accuracy, snakemake)
