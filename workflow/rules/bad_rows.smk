"""What a few bad rows do to a verdict: campaigns of the plant with and without them.

`snakemake -j2 bad_rows`. Writes results/bad_rows/{robot}.parquet, every slip with the verdicts on its case, and reports/bad_rows/.
"""

BAD_ROWS = config["bad_rows"]


rule compare_verdicts:
    input:
        robot=f"{CONFIG}/robots/{{robot}}.yaml",
        sources=sources("elastocal_proof.blind.bad_rows.compare_verdicts"),
    output:
        slips="results/bad_rows/{robot}.parquet",
    log:
        "results/logs/compare_verdicts/{robot}.log",
    benchmark:
        "results/timings/compare_verdicts/{robot}.tsv"
    params:
        step="elastocal_proof.blind.bad_rows.compare_verdicts",
        each=BAD_ROWS["each"],
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule summarize_bad_rows:
    input:
        slips=expand(rules.compare_verdicts.output.slips, robot=BAD_ROWS["robots"]),
        sources=sources("elastocal_proof.blind.bad_rows.summarize_bad_rows"),
    output:
        cases="reports/bad_rows/cases.csv",
        summary=shown(
            "reports/bad_rows/summary.csv",
            "bad_rows",
            "Bad rows",
            shows="Verdicts and rows named, with targets",
            kind="table",
        ),
    log:
        "results/logs/summarize_bad_rows.log",
    benchmark:
        "results/timings/summarize_bad_rows.tsv"
    params:
        step="elastocal_proof.blind.bad_rows.summarize_bad_rows",
        robots=BAD_ROWS["robots"],
    script:
        "../scripts/run_step.py"


rule bad_rows:
    input:
        rules.summarize_bad_rows.output,
