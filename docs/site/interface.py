"""The page of the programming interface: what people import, by what they want to do,
made of the docstrings."""

from __future__ import annotations

from importlib import import_module

HEAD = """Programming interface
=====================

From arrays to a corrected robot::

    import elastocal as ec

    robot = ec.read_robot("arm.urdf", base="base_link", tip="tool0")
    campaign = ec.Campaign(robot, joint_angles=q, positions=x, wrenches=w)
    result = ec.diagnose(campaign)
    targets = result.robot.correct(path)
    result.report("report.pdf")

The names of the first five sections are imported from ``elastocal`` itself; they are
stable: a name that has to change keeps working for at least one release with a
``DeprecationWarning``. Names below
are those of the modules that they are imported from. None of them needs Snakemake or a
configuration file. Everything else is internal and may change.

"""
# Modules, each with the names that are shown.
INTERFACE = {
    "Read a robot and a campaign": {
        "elastocal.interface.robots": ("read_robot",),
        "elastocal.interface.campaigns": ("Campaign", "read_campaign"),
        "elastocal.errors": ("InputError",),
    },
    "Plan, simulate and check": {
        "elastocal.interface.planning": (
            "plan",
            "MeasurementPlan",
            "simulate",
            "check",
        ),
    },
    "Diagnose a robot": {
        "elastocal.interface.diagnoses": ("diagnose", "DiagnosisResult"),
        "elastocal.interface.plots": ("Plots",),
    },
    "Correct a robot": {
        "elastocal.interface.corrected_robot": (
            "CorrectedRobot",
            "read_model",
            "certify",
            "verify",
        ),
        "elastocal.loop.verification": ("Verification",),
        "elastocal.application.path_correction": ("CorrectedPath",),
    },
    "Compare diagnoses": {
        "elastocal.interface.comparison": ("compare", "Comparison"),
    },
    "Move a robot": {
        "elastocal.mechanics.kinematics": (
            "compute_poses",
            "compute_poses_and_jacobians",
        ),
        "elastocal.mechanics.elastostatics": ("compute_generalized_forces",),
    },
    "Simulate a campaign": {
        "elastocal.campaigns.simulation": ("Plan", "draw_measurements")
    },
    "Plan measurements": {
        "elastocal.application.planning.survey": ("Survey",),
        "elastocal.application.planning.plan": (
            "find_allowed_candidates",
            "choose_plan",
        ),
    },
    "Diagnose": {
        "elastocal.diagnosis.diagnose": ("diagnose",),
        "elastocal.verdict": ("Verdict", "read_verdict"),
        "elastocal.effects.protocol": ("Candidate", "Parameter"),
        "elastocal.effects.catalogue": ("list_effects",),
    },
    "Use a calibrated robot": {
        "elastocal.application.calibrated": (
            "calibrate_by_fit",
            "predict_poses",
            "compute_pose_sensitivities",
        ),
        "elastocal.application.accuracy": ("predict_errors",),
        "elastocal.application.compensation": ("find_joint_targets",),
        "elastocal.application.path_correction": ("correct_path",),
    },
    "Judge predictions": {
        "elastocal.validation.held_out": (
            "compute_position_errors",
            "compute_error_intervals",
        )
    },
    "Identify compliances as in the study": {
        "elastocal.study.equation_11": (
            "estimate_compliance",
            "find_undetermined_prefixes",
        )
    },
}


def page() -> str:
    """Write the page in reStructuredText, the markup of the docstrings."""
    blocks = [HEAD]
    for title, modules in INTERFACE.items():
        blocks.append(f"{title}\n{'-' * len(title)}\n\n")
        for module, names in modules.items():
            for name in names:
                is_class = isinstance(getattr(import_module(module), name), type)
                directive = "autoclass" if is_class else "autofunction"
                blocks.append(f".. {directive}:: {module}.{name}\n\n")
    return "".join(blocks)
