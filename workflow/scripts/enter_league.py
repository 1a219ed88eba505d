"""What one method predicts of the poses of each fold, which it has not seen."""

from job import Job, run

from elastocal.io.json_files import read_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import read_table, write_table
from elastocal_proof.league.fold_tables import entry_columns, physics_of_fold
from elastocal_proof.league.methods import entered, method_from
from elastocal_proof.league.rounds import held_out_rounds, load_data_set, training_rounds
from elastocal_proof.league.schemas import ENTRIES, FITS


def enter_league(job: Job) -> None:
    split, method = job.wildcards.split, method_from(job.params.method, job.wildcards.method, "config.yaml")
    files = zip(job.input.descriptions, job.input.measurements, job.input.folds, strict=True)
    data, *others = (load_data_set(*paths) for paths in files)
    facts = read_json(job.input.facts) if job.input.facts else None
    fits = read_table(job.input.fits, FITS) if job.input.fits else None
    blocks, settings = [], {}
    for (fold, training), (_, tests) in zip(training_rounds(split, data), held_out_rounds(split, data, others), strict=True):
        fitted = physics_of_fold(method, training, facts, fits, fold)
        for number, held_out in enumerate(tests, 1 if others else 0):
            entry = entered(method, fitted, training, held_out, split, job.params.seed)
            blocks.append(entry_columns(entry, fold, number))
            settings[str(fold)] = entry.setting
    write_table(job.output.entries, ENTRIES, blocks, provenance(job.params, chosen=settings, **job.wildcards))


run(enter_league, snakemake)
