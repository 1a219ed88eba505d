"""A data set of the league, checked, with its poses dealt into folds."""

from job import Job, run

from elastocal.campaigns.columns import columns_of
from elastocal.io.json_files import write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.loop.loading import load_whole_campaign
from elastocal.loop.schemas import measurements
from elastocal.random_streams import stream
from elastocal_proof.league.folds import dealt
from elastocal_proof.league.schemas import FOLDS


def deal_league_folds(job: Job) -> None:
    descriptions, seen = load_whole_campaign(job.params.folder, job.params.robots)
    origin = provenance(job.params, **job.wildcards)
    draws = stream(job.params.seed, job.wildcards.data, "league folds", 0)
    write_table(job.output.measurements, measurements(seen.joint_angles.shape[1]), [columns_of(seen)], origin)
    write_table(job.output.folds, FOLDS, [dealt(seen, job.params.folds, draws)], origin)
    write_json(job.output.descriptions, descriptions)


run(deal_league_folds, snakemake)
