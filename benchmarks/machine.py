"""What a measurement was made with: versions, threads, kind of machine. The benchmarks print it."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version

import torch

PACKAGES = (
    "semrl",
    "ale-py",
    "gensim",
    "gymnasium",
    "numba",
    "numpy",
    "opencv-python-headless",
    "scikit-learn",
    "torch",
)


def describe() -> dict[str, object]:
    """Return versions, processor threads in use and the kind of machine."""
    return {
        "python": platform.python_version(),
        "system": platform.system(),
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "threads": torch.get_num_threads(),
        "versions": {name: _version(name) for name in PACKAGES},
    }


def sentence(machine: dict[str, object]) -> str:
    """Write the description in two lines."""
    versions = machine["versions"]
    assert isinstance(versions, dict)
    packages = ", ".join(f"{name} {number}" for name, number in versions.items())
    return (
        f"Python {machine['python']} on {machine['system']}, {machine['processor']}, {machine['cores']} cores; "
        f"one process, {machine['threads']} thread(s)\n{packages}"
    )


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
