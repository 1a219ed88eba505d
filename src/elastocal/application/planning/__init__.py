"""Where to measure: configurations and loads that say most about a robot, among those
that arm, cell and tracker allow.

Imports what `application` imports.
"""
