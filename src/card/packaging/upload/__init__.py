"""Send a validated release to the Hub: a plan, the commits, a tag and a record."""

from card.packaging.upload.run import upload

__all__ = ["upload"]
