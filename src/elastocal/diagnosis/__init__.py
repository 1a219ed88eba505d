"""What a fitted model lacks: from sufficient statistics to probabilities, an alarm, a
verdict, a refit and the next experiment.

`diagnose` finds it by the training poses alone; `judge` opens the held-out poses, once.
Read `diagnose` first: it names the steps, each of which is a module of this package.
"""
