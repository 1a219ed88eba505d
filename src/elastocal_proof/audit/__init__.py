"""An audit of a finished run: samples of its files worked out again by libraries that
share no code with the pipeline."""
