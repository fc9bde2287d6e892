"""How inner loops are compiled, everywhere alike."""

from numba import njit

compiled = njit(cache=True, nogil=True)
"""Compile a function to machine code at its first call, and keep that for other processes."""
