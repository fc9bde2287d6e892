"""How inner loops are compiled, everywhere alike."""

from numba import njit

compiled = njit(cache=True, nogil=True)
"""Compile a function to machine code at its first call, and keep that for other processes."""

vectorised = njit(cache=True, nogil=True, error_model="numpy")
"""The same where numbers are divided by what is never 0: without a check of each, several are divided at once."""
