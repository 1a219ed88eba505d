"""Figures of the study and of campaigns: tables in, figures out.

Nothing is computed here but positions on the paper.
"""
