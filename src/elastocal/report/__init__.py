"""Reports as PDF: facts and sentences for the Typst templates that stand beside them.

Imports what it reports on: `study`, `diagnosis`, `effects`.
"""
