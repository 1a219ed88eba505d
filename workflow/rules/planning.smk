"""What planning is worth: random poses that it takes to be as good as a plan, on robots for which nothing was tuned.

`snakemake -j2 planning`. Writes reports/planning/gains.csv.
"""


rule gain_by_planning:
    input:
        robot=f"{CONFIG}/robots/{{robot}}.yaml",
        sources=sources("gain_by_planning.py"),
    output:
        gains="results/planning/{robot}.json",
    log:
        "results/logs/gain_by_planning/{robot}.log",
    benchmark:
        "results/timings/gain_by_planning/{robot}.tsv"
    params:
        plan=config["planning"],
        seed=config["seed"],
    script:
        "../scripts/gain_by_planning.py"


rule tabulate_planning:
    input:
        gains=expand(rules.gain_by_planning.output.gains, robot=config["planning"]["robots"]),
        sources=sources("tabulate_planning.py"),
    output:
        table=shown(
            "reports/planning/gains.csv", "planning", "Closed loop and planning", shows="Worth of planned poses", kind="table"
        ),
    log:
        "results/logs/tabulate_planning.log",
    benchmark:
        "results/timings/tabulate_planning.tsv"
    params:
        robots=config["planning"]["robots"],
    script:
        "../scripts/tabulate_planning.py"


rule planning:
    input:
        rules.tabulate_planning.output,
