"""Matrices in the files of other finite element programs."""
