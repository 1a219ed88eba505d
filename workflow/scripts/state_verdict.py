"""The verdict, and the table of all candidates."""

import pandas as pd

from elastocal.explainable import explainable_share
from elastocal.json_files import read_json, write_json
from elastocal.loop.conclude import attributions_from, candidate_columns, concluded
from elastocal.loop.opened import opened_case, opened_fit
from elastocal.loop.schemas import CANDIDATES, FOUND, LOOKS, RIVALS
from elastocal.provenance import provenance
from elastocal.storage import read_table, write_table

from job import run


def state_verdict(job):
    case = opened_case(job.input.descriptions, job.input.training)
    declared, _ = opened_fit(case, job.input.declared, job.input.noise)
    final, found = opened_fit(case, job.input.parameters, job.input.noise, job.input.found)
    looks, rivals = read_table(job.input.looks, LOOKS), read_table(job.input.rivals, RIVALS)
    table = read_table(job.input.found, FOUND)
    p_values = dict(zip(table["candidate"], table["p_family"], strict=True))
    errors = read_json(job.input.errors)
    verdict = concluded(
        case,
        read_json(job.input.noise),
        declared,
        final,
        attributions_from(rivals, found, p_values),
        read_json(job.input.doubts),
        looks,
        pd.read_csv(job.input.before_after).to_dict("records"),
        errors["heldout"],
        read_json(job.input.faults),
        errors["warnings"],
        [explainable_share(fitted, case.observations) for fitted in (declared, final)],
    )
    write_table(job.output.candidates, CANDIDATES, [candidate_columns(looks, rivals)], provenance({}, **job.wildcards))
    write_json(job.output.verdict, verdict, allow_nan=False)


run(state_verdict, snakemake)
