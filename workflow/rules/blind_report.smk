"""What comes after the verdicts of the blind proof: the oracle, the scores.

Needs data/blind/, data/sealed/ and the verdicts of results/blind/. Writes results/blind/oracle/ and reports/blind/.
"""


rule oracle_cases:
    input:
        blind=rules.make_cases.output.blind,
        sealed=rules.make_cases.output.sealed,
        manifest=rules.seal_cases.output.manifest,
        verdicts=rules.diagnose_cases.output.verdicts,
        sources=sources("oracle_cases.py"),
    output:
        oracle="results/blind/oracle/{block}.json",
    log:
        "results/logs/oracle_cases/{block}.log",
    benchmark:
        "results/timings/oracle_cases/{block}.tsv"
    params:
        seed=config["seed"],
    script:
        "../scripts/oracle_cases.py"


rule score_cases:
    input:
        sealed=expand(rules.make_cases.output.sealed, block=BLIND),
        manifest=rules.seal_cases.output.manifest,
        verdicts=expand(rules.diagnose_cases.output.verdicts, block=BLIND),
        oracles=expand(rules.oracle_cases.output.oracle, block=BLIND),
        sources=sources("score_cases.py"),
    output:
        cases="reports/blind/cases.csv",
        summary="reports/blind/summary.csv",
        settings="reports/blind/settings.csv",
        confusion="reports/blind/confusion.csv",
        power="reports/blind/power.csv",
        coverage="reports/blind/coverage.csv",
        undetectable="reports/blind/undetectable.csv",
    log:
        "results/logs/score_cases.log",
    benchmark:
        "results/timings/score_cases.tsv"
    params:
        seed=config["seed"],
    script:
        "../scripts/score_cases.py"


rule blind:
    input:
        rules.score_cases.output,
