"""Elastostatic calibration of serial robots: the science, importable without the pipeline that runs it.

Rooms, from the ground up; each imports only what stands above it here, as `[tool.importlinter]` of pyproject.toml has it:

    errors, random_streams                refusal of bad input in one line; named streams of random numbers
    io, mechanics                         files; chain, kinematics, elastostatics
    study                                 the simulation study (beside all that follows until figures)
    campaigns, effects                    measured campaigns; the catalogue of physical effects
    fitting                               the model of a campaign and its fit
    data_checks, validation               faults of the data; held-out poses
    diagnosis                             what a fitted model lacks
    loop                                  from a campaign's folder to the verdict
    figures, report                       what people see

What proves it is a package of its own, `elastocal_proof`, which `elastocal demo` alone imports.
"""

__version__ = "0.1.0"
