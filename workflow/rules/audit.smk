"""The audit: recompute samples of every file of a finished run with libraries that share no code with the pipeline.

`make audit` first makes what `make paper` makes, if it is missing, then writes reports/audit.html and reports/audit.csv. If all checks
hold, it also writes reports/audit.txt; otherwise it ends with an error. Finished files of other targets, such as blind, are audited too.
"""

# Files that their jobs make again, byte by byte, from the files that are recomputed.
REMADE = [
    r"reports/figures/.*",
    r"reports/(paper|study)\.pdf",
    r"reports/answers\.json",
    r"reports/tables/.*\.csv",
    r"results/(budget|ladder|simulated_designs|studies|uses)/.*",
    *(
        rf"{folder}/loop/{campaign}/.*"
        for campaign in AUDITED_CAMPAIGNS
        for folder in ("reports", "results")
    ),
]


rule remake_files:
    input:
        files=audited,
    output:
        digests="results/remade.json",
    params:
        remade=REMADE,
        configuration={key: value for key, value in config.items() if key != "origin"},
        snakefile=str(ROOT / "Snakefile"),
        others=digest_others,
    script:
        "../scripts/remake_files.py"


rule trace_evidence:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        training=rules.read_campaign.output.training,
    output:
        evidence="results/evidence/{campaign}.json",
    params:
        seed=config["seed"],
    script:
        "../scripts/trace_evidence.py"


rule audit_files:
    input:
        files=audited,
        evidence=evidence_of_finished,
        remade=rules.remake_files.output.digests,
        reference=f"{CONFIG}/paper/reference.csv",
    output:
        table="reports/audit.csv",
        page=shown("reports/audit.html", "audit", "Audit", shows="The audit", kind="report"),
    params:
        robots=STUDY.robots,
        strategies=STUDY.strategies,
        configuration={key: config[key] for key in AUDITED_KEYS},
        rows=config["audit"]["rows"],
        others=digest_others,
    script:
        "../scripts/audit_files.py"


rule judge_audit:
    input:
        table=rules.audit_files.output.table,
        page=rules.audit_files.output.page,
    output:
        verdict="reports/audit.txt",
    script:
        "../scripts/judge_audit.py"


rule audit:
    input:
        rules.audit_files.output,
        rules.judge_audit.output,
