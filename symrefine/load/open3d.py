"""Open3D, which takes a second to import and needs a library that bare machines lack."""

import ctypes
from functools import cache
from typing import Any


@cache
def open3d() -> Any:
    """The module, with libusb in front of it."""
    import libusb_package

    ctypes.CDLL(str(libusb_package.get_library_path()))
    import open3d as module

    return module
