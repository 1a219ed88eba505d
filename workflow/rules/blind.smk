"""The blind proof: sealed cases on an independent plant, diagnosed without their ground truths, scored with them.

`snakemake -j2 blind` makes the size quick; `--config blind=full` the whole. Writes data/blind/, data/sealed/,
results/blind/{block}.json and reports/blind/manifest.sha256. What is sealed is read by seal_cases here and, after the diagnosis, by
oracle_cases, score_cases and score_follow_ups.
"""

BLIND_BLOCKS = {"smoke": 1, "quick": 10, "development": 20, "full": 60}[config["blind"]]
# Those of the proof among them are used by the size full alone.
BLIND_ROBOTS = ["kuka", "fanuc", "abb", "iiwa14", "gp180", "panda", "m900ib700"]
BLIND = [f"{config['blind']}_{number}" for number in range(1, BLIND_BLOCKS + 1)]


rule make_cases:
    input:
        robots=expand(f"{CONFIG}/robots/{{robot}}.yaml", robot=BLIND_ROBOTS),
        sources=sources("make_cases.py"),
    output:
        blind=directory("data/blind/{block}"),
        sealed=directory("data/sealed/{block}"),
    log:
        "results/logs/make_cases/{block}.log",
    benchmark:
        "results/timings/make_cases/{block}.tsv"
    params:
        size=config["blind"],
        number=lambda wildcards: int(wildcards.block.rsplit("_", 1)[1]),
        blocks=BLIND_BLOCKS,
        seed=config["seed"],
    script:
        "../scripts/make_cases.py"


rule seal_cases:
    input:
        sealed=expand(rules.make_cases.output.sealed, block=BLIND),
        sources=sources("seal_cases.py"),
    output:
        manifest="reports/blind/manifest.sha256",
    log:
        "results/logs/seal_cases.log",
    benchmark:
        "results/timings/seal_cases.tsv"
    script:
        "../scripts/seal_cases.py"


rule diagnose_cases:
    input:
        blind=rules.make_cases.output.blind,
        manifest=rules.seal_cases.output.manifest,
        sources=sources("diagnose_cases.py"),
    output:
        verdicts="results/blind/{block}.json",
    log:
        "results/logs/diagnose_cases/{block}.log",
    benchmark:
        "results/timings/diagnose_cases/{block}.tsv"
    params:
        seed=config["seed"],
        robots=f"{CONFIG}/robots",
    script:
        "../scripts/diagnose_cases.py"
