"""The catalogue of physical effects that a calibrated model may lack, by what they have
in common.

An effect is a function that `protocol.effect` decorates, in whatever module of this
package. Imports `mechanics` alone.
"""
