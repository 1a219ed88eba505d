"""What a few bad rows do to a verdict: campaigns of the plant with and without them.

`snakemake -j2 bad_rows`. Writes results/bad_rows/{robot}.parquet, every slip with the verdicts on its case, and reports/bad_rows/.
"""

BAD_ROWS = config["bad_rows"]


rule compare_verdicts:
    input:
        robot=f"{CONFIG}/robots/{{robot}}.yaml",
        sources=sources("compare_verdicts.py"),
    output:
        slips="results/bad_rows/{robot}.parquet",
    log:
        "results/logs/compare_verdicts/{robot}.log",
    benchmark:
        "results/timings/compare_verdicts/{robot}.tsv"
    params:
        each=BAD_ROWS["each"],
        seed=config["seed"],
    script:
        "../scripts/compare_verdicts.py"


rule summarize_bad_rows:
    input:
        slips=expand(rules.compare_verdicts.output.slips, robot=BAD_ROWS["robots"]),
        sources=sources("summarize_bad_rows.py"),
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
        robots=BAD_ROWS["robots"],
    script:
        "../scripts/summarize_bad_rows.py"


rule bad_rows:
    input:
        rules.summarize_bad_rows.output,
