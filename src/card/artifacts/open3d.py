"""Open3D with the shared library that its wheel expects from the system."""

import ctypes
from functools import cache
from typing import Any


@cache
def import_open3d() -> Any:
    """The ``open3d`` module; libusb-1.0 comes from the ``libusb-package`` wheel, not from the system."""
    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    import open3d

    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    return open3d
