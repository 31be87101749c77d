"""``garden doctor``: tell what this machine can run and what is missing."""

from __future__ import annotations

import argparse
import os
import platform
import shutil
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from flows.command import EXIT_FAILED, EXIT_OK, print_json
from flows.command.store_option import store_address
from garden_models.foundation import ADAPTERS
from storage import StoreError
from storage.address import find_medium, is_remote
from storage.store import MARKER
from tasks.model.found import FoundModel, found_model
from tasks.model.settings import settings_file
from tasks.vlm.server import GEMINI_KEYS, OPENAI_KEY

PACKAGES = (
    "torch", "prefect", "fastapi", "zarr", "pyarrow", "pycolmap", "mujoco", "trimesh",
    "opencv-python-headless", "coacd",
)  # fmt: skip
NEEDED_GB_MEMORY, NEEDED_GB_DISK = 5.0, 2.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = (
        "Tell what this machine can run, what is missing, and where it goes. The embedded"
        " backends need none of the paper's models."
    )


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    findings = [*_packages(), _cores(), _memory(), _store(options), _gpu(), _keys()]
    broken = [f for f in findings if f["state"] == "missing"]
    models = [found_model(name) for name in ADAPTERS]
    if options.json:
        status = "failed" if broken else "ok"
        print_json({"status": status, "findings": findings, "models": [_model(m) for m in models]})
    else:
        for finding in findings:
            print(f"{finding['state']:<8} {finding['what']:<26} {finding['note']}")
        print(f"\nThe paper's models (settings: {settings_file()})")
        for model in models:
            _tell(model)
    return EXIT_FAILED if broken else EXIT_OK


def _finding(what: str, state: str, note: str) -> dict[str, str]:
    return {"what": what, "state": state, "note": note}


def _model(found: FoundModel) -> dict[str, Any]:
    return {
        "name": found.card.name,
        "title": found.card.title,
        "stage": found.card.stage,
        "state": found.state,
        "variant": found.variant,
        "weights": str(found.weights or ""),
        "digest": found.digest,
        "device": found.device,
        "environment": found.environment,
        "code_licence": found.terms.code,
        "weights_licence": found.terms.weights,
        "commercial_use": found.terms.commercial,
        "problems": list(found.problems),
    }


def _tell(found: FoundModel) -> None:
    """Print a model: its state, its terms, its weights, and what is missing."""
    card, terms = found.card, found.terms
    use = "commercial use allowed" if terms.commercial else "no commercial use"
    name = f"{card.name}/{found.variant}" if found.variant else card.name
    print(f"{found.state:<8} {name:<26} {card.title}, for the step {card.stage}")
    print(f"{'':<35} code {terms.code}, weights {terms.weights}: {use}")
    if found.digest:
        print(f"{'':<35} {found.weights} ({found.digest}) on {found.device or 'no device'}")
    for problem in found.problems:
        print(f"{'':<35} {problem}")


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


def _keys() -> dict[str, str]:
    """Tell which keys to models that propose targets there are, by their variables' names."""
    known = (*GEMINI_KEYS, OPENAI_KEY)
    found = [name for name in known if os.environ.get(name, "").strip()]
    if found:
        return _finding("keys for --propose", "ok", f"{' and '.join(found)} set")
    return _finding("keys for --propose", "none", f"none of {', '.join(known)} is set")


def _gpu() -> dict[str, str]:
    import torch

    if torch.cuda.is_available():
        names = []
        for i in range(torch.cuda.device_count()):
            about = torch.cuda.get_device_properties(i)
            names.append(f"{about.name}, {about.total_memory / 1e9:.0f} GB")
        return _finding("gpu", "ok", "; ".join(names))
    return _finding("gpu", "none", "the embedded backends run on the CPU")
