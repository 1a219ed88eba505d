"""The catalogue: physical effects that a reduced joint-compliance model lacks, one module each."""
