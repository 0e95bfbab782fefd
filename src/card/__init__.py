"""Release pipeline for road-topography driving datasets."""

__version__ = "0.1.0"
