"""What the training poses of each fold lack, by the whole diagnosis."""

from job import Job, run

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.io.json_files import write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal_proof.league.fold_tables import fold_facts, fold_fits, mechanism_columns
from elastocal_proof.league.rounds import load_data_set, training_rounds
from elastocal_proof.league.schemas import FITS, MECHANISMS


def diagnose_league_folds(job: Job) -> None:
    data = load_data_set(job.input.descriptions, job.input.measurements, job.input.folds)
    facts, fits, mechanisms = {}, [], []
    for fold, training in training_rounds(job.wildcards.split, data):
        found = diagnose(training, Settings(), job.params.seed)
        facts[str(fold)] = fold_facts(found)
        fits.append(fold_fits(found, fold))
        mechanisms.append(mechanism_columns(found, fold))
    origin = provenance(job.params, **job.wildcards)
    write_json(job.output.facts, facts)
    write_table(job.output.fits, FITS, fits, origin)
    write_table(job.output.mechanisms, MECHANISMS, mechanisms, origin)


run(diagnose_league_folds, snakemake)
