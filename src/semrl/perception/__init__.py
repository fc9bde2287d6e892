"""Elevation, the upper line of Fig. 1.1: from a raw frame to the state that an agent sees, one folder a box."""
