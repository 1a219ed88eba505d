"""How good a robot is: repeatability, errors over the workspace, what each effect costs, what changed since another campaign.

Imports what `application` imports.
"""
