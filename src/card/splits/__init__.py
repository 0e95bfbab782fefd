"""Splits: strata, groups and the append-only ledger."""

from card.splits.assign import assign
from card.splits.extend import extend_ledger
from card.splits.ledger import check_append_only

__all__ = ["assign", "check_append_only", "extend_ledger"]
