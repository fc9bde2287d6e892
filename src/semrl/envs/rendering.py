"""What our own worlds ask of a render mode."""

from typing import Any

from semrl.core.errors import UsageError


def check_render_mode(mode: str | None, metadata: dict[str, Any]) -> None:
    """Raise `UsageError` unless the mode is None or one of ``metadata["render_modes"]``."""
    if mode is not None and mode not in metadata["render_modes"]:
        raise UsageError(f"render mode must be one of {metadata['render_modes']} or None, not {mode!r}")
