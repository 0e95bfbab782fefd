"""Privacy: detect faces and plates, redact them losslessly, account for it."""

from card.privacy.anonymize import anonymize

__all__ = ["anonymize"]
