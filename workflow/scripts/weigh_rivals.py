"""The effects found against everything else that could have made the residual, and what to measure to tell them apart."""

from elastocal.attribution import attribute
from elastocal.frames import write_csv
from elastocal.json_files import write_json
from elastocal.law_check import doubts
from elastocal.loop.experiment import proposal_frame
from elastocal.loop.opened import opened_case, opened_fit
from elastocal.loop.schemas import FOUND, RIVALS
from elastocal.loop.search_columns import rival_blocks
from elastocal.provenance import provenance
from elastocal.random_streams import stream
from elastocal.storage import read_table, write_table

from job import run


def weigh_rivals(job):
    case = opened_case(job.input.descriptions, job.input.training)
    final, found = opened_fit(case, job.input.parameters, job.input.noise, job.input.found)
    table = read_table(job.input.found, FOUND)
    p_values = dict(zip(table["candidate"], table["p_family"], strict=True))
    attributions = attribute(final, found, p_values, case.observations, list(case.candidates.values()))
    write_table(job.output.rivals, RIVALS, rival_blocks(attributions), provenance({}, **job.wildcards))
    write_json(job.output.doubts, [vars(doubt) for doubt in doubts(final, found, case.observations)])
    draws = stream(job.params.seed, case.campaign.name, "next experiment", 0)
    write_csv(job.output.experiment, proposal_frame(case, final, attributions, job.params.states, draws))


run(weigh_rivals, snakemake)
