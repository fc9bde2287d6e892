"""Symbolic plans in discrete worlds: operators learned from play, A*, PDDL."""
