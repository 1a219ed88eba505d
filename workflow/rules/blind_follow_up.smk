"""The loop once more on blind cases that end in a class: propose, carry out on the same plant, diagnose anew, score.

Four rules, so that the analyst's two run in processes of their own: propose_follow_ups and diagnose_follow_ups get campaigns and
verdicts; carry_out_follow_ups gets angles and loads, and finds the robot by the name of the case; only score_follow_ups reads
what is sealed.
"""


rule propose_follow_ups:
    input:
        blind=rules.make_cases.output.blind,
        verdicts=rules.diagnose_cases.output.verdicts,
        sources=sources("propose_follow_ups.py"),
    output:
        proposals="results/blind/proposed/{block}.csv",
    log:
        "results/logs/propose_follow_ups/{block}.log",
    benchmark:
        "results/timings/propose_follow_ups/{block}.tsv"
    params:
        size=config["blind"],
        seed=config["seed"],
        robots=f"{CONFIG}/robots",
    script:
        "../scripts/propose_follow_ups.py"


rule carry_out_follow_ups:
    input:
        proposals=rules.propose_follow_ups.output.proposals,
        robots=expand(f"{CONFIG}/robots/{{robot}}.yaml", robot=BLIND_ROBOTS),
        sources=sources("carry_out_follow_ups.py"),
    output:
        campaigns=directory("data/follow_up/{block}"),
    log:
        "results/logs/carry_out_follow_ups/{block}.log",
    benchmark:
        "results/timings/carry_out_follow_ups/{block}.tsv"
    params:
        size=config["blind"],
        seed=config["seed"],
    script:
        "../scripts/carry_out_follow_ups.py"


rule diagnose_follow_ups:
    input:
        campaigns=rules.carry_out_follow_ups.output.campaigns,
        sources=sources("diagnose_follow_ups.py"),
    output:
        verdicts="results/blind/follow_up/{block}.json",
    log:
        "results/logs/diagnose_follow_ups/{block}.log",
    benchmark:
        "results/timings/diagnose_follow_ups/{block}.tsv"
    params:
        seed=config["seed"],
        robots=f"{CONFIG}/robots",
    script:
        "../scripts/diagnose_follow_ups.py"


rule score_follow_ups:
    input:
        sealed=expand(rules.make_cases.output.sealed, block=BLIND),
        manifest=rules.seal_cases.output.manifest,
        first=expand(rules.diagnose_cases.output.verdicts, block=BLIND),
        proposals=expand(rules.propose_follow_ups.output.proposals, block=BLIND),
        anew=expand(rules.diagnose_follow_ups.output.verdicts, block=BLIND),
        sources=sources("score_follow_ups.py"),
    output:
        rates=shown(
            "reports/blind/follow_up.csv", "blind_follow_up", "Blind proof", shows="Names after further poses", kind="table"
        ),
        separable="reports/blind/follow_up_separable.csv",
        others="reports/blind/follow_up_other.csv",
        poses="reports/blind/follow_up_poses.csv",
        promises="reports/blind/follow_up_promises.csv",
        cases="reports/blind/follow_up_cases.csv",
    log:
        "results/logs/score_follow_ups.log",
    benchmark:
        "results/timings/score_follow_ups.tsv"
    script:
        "../scripts/score_follow_ups.py"


rule blind_follow_up:
    input:
        rules.score_follow_ups.output,


rule score_sweep:
    input:
        sealed=expand(rules.make_cases.output.sealed, block=BLIND),
        manifest=rules.seal_cases.output.manifest,
        verdicts=expand(rules.diagnose_cases.output.verdicts, block=BLIND),
        sources=sources("score_sweep.py"),
    output:
        table="reports/blind/sweep.csv",
        cases="reports/blind/sweep_cases.csv",
        pdf="reports/blind/figures/sweep.pdf",
        png=shown(
            "reports/blind/figures/sweep.png",
            "blind_sweep",
            "Blind proof",
            shows="How near relatives are named",
            kind="figure",
        ),
    log:
        "results/logs/score_sweep.log",
    benchmark:
        "results/timings/score_sweep.tsv"
    script:
        "../scripts/score_sweep.py"
