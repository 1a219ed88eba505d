"""What to measure next for the first cases of a block that end in a class; this process opens no sealed file."""

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json
from elastocal_proof.blind.follow_up import LADDER, MOST, POSES, followed_up
from elastocal_proof.blind.proposed import proposed


def propose_follow_ups(job: Job) -> None:
    frames = [pd.DataFrame({"case": []})]
    for verdict in followed_up(read_json(job.input.verdicts), MOST[job.params.size]):
        folder = f"{job.input.blind}/{verdict['campaign']}"
        frame = proposed(folder, job.params.robots, max(POSES), LADDER, job.params.seed)
        frames.append(frame.assign(case=verdict["campaign"]))
    write_csv(job.output.proposals, pd.concat(frames, ignore_index=True))


run(propose_follow_ups, snakemake)
