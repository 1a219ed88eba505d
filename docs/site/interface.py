"""The page of the programming interface: what people import, by what they want to do,
made of the docstrings."""

from __future__ import annotations

from importlib import import_module

HEAD = """Programming interface
=====================

The public functions and classes of ``elastocal``, from their docstrings. None of them
needs Snakemake or a configuration file. Everything else is internal and may change; its
docstrings are in the source.

"""
# Modules, each with the names that are shown.
INTERFACE = {
    "Read a robot and a campaign": {
        "elastocal.campaigns.reading": ("read_robot", "read_campaign")
    },
    "Move a robot": {
        "elastocal.mechanics.kinematics": ("poses", "poses_and_jacobians"),
        "elastocal.mechanics.elastostatics": ("generalized_forces",),
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
        "elastocal.effects.protocol": ("Candidate", "Parameter"),
        "elastocal.effects.catalogue": ("effects",),
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
        "elastocal.validation.held_out": ("position_errors", "intervals")
    },
    "Identify compliances as in the study": {
        "elastocal.study.equation_11": (
            "estimate_compliance",
            "find_undetermined_prefixes",
        )
    },
}


def page() -> str:
    """The page, in reStructuredText as the docstrings are."""
    parts = [HEAD]
    for title, modules in INTERFACE.items():
        parts.append(f"{title}\n{'-' * len(title)}\n\n")
        for module, names in modules.items():
            for name in names:
                kind = (
                    "autoclass"
                    if isinstance(getattr(import_module(module), name), type)
                    else "autofunction"
                )
                parts.append(f".. {kind}:: {module}.{name}\n\n")
    return "".join(parts)
