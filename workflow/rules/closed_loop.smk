"""The closed loop: a simulated robot is measured, diagnosed, commanded with the corrected targets and measured again.

`snakemake -j2 closed_loop`. Writes results/closed_loop/{robot}.parquet with every commanded pose, and reports/closed_loop/.
coverage.csv there compares the stated accuracy of a corrected robot with its true accuracy, for a known and an unknown base.
"""

CLOSED_LOOP = config["closed_loop"]


rule close_loop:
    input:
        robot=f"{CONFIG}/robots/{{robot}}.yaml",
    output:
        moved="results/closed_loop/{robot}.parquet",
    params:
        step="elastocal_proof.blind.closed_loop.close_loop",
        each=CLOSED_LOOP["each"],
        slips=CLOSED_LOOP["slips"],
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule summarize_closed_loop:
    input:
        moved=expand(rules.close_loop.output.moved, robot=CLOSED_LOOP["robots"]),
        robots=expand(f"{CONFIG}/robots/{{robot}}.yaml", robot=CLOSED_LOOP["robots"]),
    output:
        errors="reports/closed_loop/cases.csv",
        summary=shown(
            "reports/closed_loop/closed_loop.csv",
            "closed_loop",
            "Closed loop",
            shows="Errors by robot and model",
            kind="table",
        ),
        goals="reports/closed_loop/goals.csv",
    params:
        step="elastocal_proof.blind.closed_loop.summarize_closed_loop",
        robots=CLOSED_LOOP["robots"],
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule draw_closed_loop:
    input:
        summary=rules.summarize_closed_loop.output.summary,
        robots=rules.summarize_closed_loop.input.robots,
    output:
        figure="reports/closed_loop/closed_loop.pdf",
        picture=shown(
            "reports/closed_loop/closed_loop.png",
            "closed_loop",
            "Closed loop",
            shows="Errors after correction",
            kind="figure",
        ),
    params:
        step="elastocal_proof.figures.blind.draw_closed_loop",
    script:
        "../scripts/run_step.py"


rule state_accuracy:
    input:
        robot=f"{CONFIG}/robots/{{robot}}.yaml",
    output:
        stated="results/closed_loop/stated/{robot}_{frame}.csv",
    wildcard_constraints:
        frame="base|tracker",
    params:
        step="elastocal_proof.blind.closed_loop.state_accuracy",
        each=CLOSED_LOOP["stated"],
        seed=config["seed"],
    script:
        "../scripts/run_step.py"


rule tabulate_coverage:
    input:
        stated=expand(
            rules.state_accuracy.output.stated,
            robot=CLOSED_LOOP["robots"],
            frame=["base", "tracker"],
        ),
    output:
        cases="reports/closed_loop/stated.csv",
        coverage="reports/closed_loop/coverage.csv",
    params:
        step="elastocal_proof.blind.closed_loop.tabulate_coverage",
    script:
        "../scripts/run_step.py"


rule closed_loop:
    input:
        rules.summarize_closed_loop.output,
        rules.draw_closed_loop.output,
        rules.tabulate_coverage.output,
