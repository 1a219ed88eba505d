"""What the oracle and the best analyst do on a block of blind cases, once they are diagnosed."""

from pathlib import Path

from job import Job, run

from elastocal.io.json_files import read_json, write_json
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.blind.limit import limit_of_sample
from elastocal_proof.blind.oracle import oracle


def oracle_cases(job: Job) -> None:
    truths = load_ground_truth(Path(job.input.sealed).glob("*.json"), job.input.manifest)
    verdicts = {verdict["campaign"]: verdict for verdict in read_json(job.input.verdicts)}
    found = {}
    for name, truth in truths.items():
        informed = oracle(truth, verdicts[name], f"{job.input.blind}/{name}", job.params.robots, job.params.seed)
        found[name] = {"oracle": informed, "limit": limit_of_sample(truth, job.params.robots)}
    write_json(job.output.oracle, found, allow_nan=False)


run(oracle_cases, snakemake)
