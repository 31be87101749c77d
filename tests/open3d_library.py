"""Load Open3D, which the tests hold our files and geometry against.

It needs libusb even where no camera is; the PyPI package carries one for bare machines.
"""

from __future__ import annotations

import ctypes

import libusb_package

ctypes.CDLL(str(libusb_package.get_library_path()), ctypes.RTLD_GLOBAL)

import open3d  # noqa: E402  (finds libusb only once it is loaded)

__all__ = ["open3d"]
