"""Evaluators of model files, to be copied to where a robot runs: `elastocal_model.py`
needs numpy alone, `elastocal_model.hpp` is C++17 without dependencies. Neither imports
anything of this package."""
