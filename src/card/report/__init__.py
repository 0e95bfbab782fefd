"""The report page of a release."""

from card.report.page import page

__all__ = ["page"]
