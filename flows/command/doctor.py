"""``garden doctor``: tell what this machine can run and what is missing."""

from __future__ import annotations

import argparse
import os
import platform
import shutil
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from flows.command import EXIT_FAILED, EXIT_OK, print_json
from flows.command.store_option import store_address
from storage import StoreError
from storage.address import find_medium, is_remote
from storage.store import MARKER

PACKAGES = (
    "torch", "prefect", "fastapi", "zarr", "pyarrow", "pycolmap", "mujoco", "trimesh",
    "opencv-python-headless", "coacd",
)  # fmt: skip
NEEDED_GB_MEMORY, NEEDED_GB_DISK = 5.0, 2.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = "Tell what this machine can run, and what is missing and why it matters."


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    findings = [*_packages(), _cores(), _memory(), _store(options), _gpu()]
    broken = [f for f in findings if f["state"] == "missing"]
    if options.json:
        print_json({"status": "failed" if broken else "ok", "findings": findings})
    else:
        for finding in findings:
            print(f"{finding['state']:<8} {finding['what']:<26} {finding['note']}")
    return EXIT_FAILED if broken else EXIT_OK


def _finding(what: str, state: str, note: str) -> dict[str, str]:
    return {"what": what, "state": state, "note": note}


def _packages() -> list[dict[str, str]]:
    findings = []
    for name in PACKAGES:
        try:
            findings.append(_finding(name, "ok", version(name)))
        except PackageNotFoundError:
            findings.append(_finding(name, "missing", "run `make install`"))
    return findings


def _cores() -> dict[str, str]:
    return _finding("cores", "ok", f"{os.cpu_count()} ({platform.machine()})")


def _memory() -> dict[str, str]:
    free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9
    enough = free >= NEEDED_GB_MEMORY
    note = f"{free:.1f} GB free" + ("" if enough else f"; a scene may need {NEEDED_GB_MEMORY:g} GB")
    return _finding("memory", "ok" if enough else "low", note)


def _store(options: argparse.Namespace) -> dict[str, str]:
    address = store_address(options.store)
    return _bucket(address) if is_remote(address) else _disk(Path(address).expanduser().absolute())


def _bucket(address: str) -> dict[str, str]:
    try:
        medium = find_medium(address)
        if medium.read(MARKER) is None:
            medium.prepare()
            return _finding("store", "ok", f"{address}, empty so far")
    except (StoreError, OSError) as error:
        return _finding("store", "missing", getattr(error, "strerror", None) or str(error))
    return _finding("store", "ok", address)


def _disk(folder: Path) -> dict[str, str]:
    existing: Path = next(p for p in (folder, *folder.parents) if p.exists())
    free = shutil.disk_usage(existing).free / 1e9
    enough = free >= NEEDED_GB_DISK
    return _finding("store", "ok" if enough else "low", f"{folder}, {free:.0f} GB free")


def _gpu() -> dict[str, str]:
    import torch

    if torch.cuda.is_available():
        return _finding("gpu", "ok", torch.cuda.get_device_name(0))
    return _finding("gpu", "none", "the embedded backends run on the CPU")
