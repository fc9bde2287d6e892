"""What perception learns before the agent begins (§3.2.3)."""
