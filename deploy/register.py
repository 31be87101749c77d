"""Tell a Prefect server what GARDEN runs on it: pool, deployments, schedules, automations.

Run it again after any change; it changes what is there and adds what is missing. The server is
the one that PREFECT_API_URL names.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import httpx
import yaml

HOME = Path(__file__).resolve().parents[1]
DEPLOYMENTS = HOME / "deploy" / "prefect.yaml"
AUTOMATIONS = HOME / "deploy" / "automations.yaml"
POOL = "garden"


def main(arguments: list[str] | None = None) -> int:
    """Register everything; return the exit code (0 done, 1 the server refused, 2 wrong use)."""
    options = _options(arguments)
    api = os.environ.get("PREFECT_API_URL")
    if not api:
        return _wrong("set PREFECT_API_URL to the server's address, e.g. http://127.0.0.1:4200/api")
    if options.collection and not Path(options.collection).exists():
        return _wrong(f"no such collection: {options.collection}")
    if not _is_up(api, options.wait):
        return _wrong(f"no Prefect server answers at {api}: start one with 'prefect server start'")
    environment = os.environ | _variables(options)
    if _prefect(environment, "work-pool", "inspect", POOL).returncode:
        _must(_prefect(environment, "work-pool", "create", POOL, "--type", "process"))
    names = _names(bool(options.collection))
    chosen = [part for name in names for part in ("--name", name)]
    _must(_prefect(environment, "deploy", "--prefect-file", str(DEPLOYMENTS), *chosen))
    print(f"registered in the work pool {POOL}: {', '.join(names)}")
    for name in apply_automations(AUTOMATIONS):
        print(f"automation: {name}")
    if not options.collection:
        print("no collection is scheduled: give one with --collection FILE")
    return 0


def apply_automations(path: Path) -> list[str]:
    """Create the file's automations on the server, or update those of the same name."""
    from prefect.client.orchestration import get_client
    from prefect.events.schemas.automations import AutomationCore

    written = yaml.safe_load(path.read_text())["automations"]
    wanted = [AutomationCore.model_validate(automation) for automation in written]
    with get_client(sync_client=True) as client:
        for automation in wanted:
            present = client.read_automations_by_name(automation.name)
            for known in present[:1]:
                client.update_automation(known.id, automation)
            for double in present[1:]:
                client.delete_automation(double.id)
            if not present:
                client.create_automation(automation)
    return [automation.name for automation in wanted]


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--collection", metavar="FILE", default=os.environ.get("GARDEN_COLLECTION"),
        help="a collection to run every night and to measure every week ($GARDEN_COLLECTION)",
    )  # fmt: skip
    parser.add_argument(
        "--out", metavar="FOLDER", default=os.environ.get("GARDEN_OUT", str(HOME / "scenes")),
        help="where the workers write packages and reports ($GARDEN_OUT)",
    )  # fmt: skip
    parser.add_argument(
        "--timezone", default=os.environ.get("GARDEN_TIMEZONE") or local_timezone(),
        help="of the schedules, e.g. Europe/Zurich ($GARDEN_TIMEZONE; this machine's)",
    )  # fmt: skip
    parser.add_argument(
        "--wait", type=float, default=120.0, metavar="SECONDS", help="how long for the server"
    )
    return parser.parse_args(arguments)


def _variables(options: argparse.Namespace) -> dict[str, str]:
    """Return what prefect.yaml refers to."""
    collection = Path(options.collection).absolute() if options.collection else ""
    return {
        "GARDEN_HOME": str(HOME),
        "GARDEN_OUT": str(Path(options.out).absolute()),
        "GARDEN_COLLECTION": str(collection),
        "GARDEN_TIMEZONE": options.timezone,
    }


def _names(with_collection: bool) -> list[str]:
    """Return the deployments to register; a schedule without a collection would only fail."""
    return [
        deployment["name"]
        for deployment in yaml.safe_load(DEPLOYMENTS.read_text())["deployments"]
        if with_collection or "collection" not in deployment.get("parameters", {})
    ]


def local_timezone() -> str:
    """Return this machine's time zone by its IANA name, or UTC."""
    link = Path("/etc/localtime")
    _, found, zone = str(link.resolve()).partition("zoneinfo/")
    return zone if found and link.exists() else "UTC"


def _is_up(api: str, seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while True:
        try:
            if httpx.get(f"{api}/health", timeout=5).is_success:
                return True
        except httpx.HTTPError:
            pass
        if time.monotonic() > deadline:
            return False
        time.sleep(0.5)


def _prefect(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "prefect", "--no-prompt", *arguments],
        cwd=HOME, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip


def _must(done: subprocess.CompletedProcess[str]) -> None:
    if done.returncode:
        print(done.stdout + done.stderr, file=sys.stderr)
        raise SystemExit(1)


def _wrong(message: str) -> int:
    print(message, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
