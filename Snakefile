"""The study: every table and figure of the paper, from seeds. `snakemake -j2` makes all of it."""

configfile: "config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/simulate.smk"
include: "workflow/rules/identify.smk"
include: "workflow/rules/evaluate.smk"


rule all:
    default_target: True
    input:
        expand(rules.evaluate.output.metrics, robot=config["robots"], noise=NOISE, strategy=config["strategies"]),
