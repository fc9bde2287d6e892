"""Results as figures and one self-contained HTML page: takes rows and arrays from files, never models."""

from semrl.report.page import write_report

__all__ = ["write_report"]
