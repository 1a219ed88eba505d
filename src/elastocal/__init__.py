"""Elastostatic calibration of serial robots: the science, importable without the
pipeline that runs it.

Its packages and their layers stand in `[tool.importlinter]` of pyproject.toml, from the ground up;
docs/architecture.md says what each is for. What proves it is a package of its own,
`elastocal_proof`, which `elastocal demo` alone imports.
"""

__version__ = "0.1.0"
