"""Matrices of other finite element programs."""
