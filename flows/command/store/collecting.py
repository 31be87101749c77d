"""Free room in a store."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable

from flows.command import EXIT_FAILED, EXIT_OK, print_json
from flows.command.store_option import open_store
from storage import Keep, Store
from storage.collect import Collected
from storage.quantities import parse_bytes, parse_seconds, show_bytes
from storage.quota import configured_quota

_SHOWN = 20

_GC = """\
Without options gc removes only what no result needs: objects and files that crashed or
replaced runs left. --quota and --unused also forget results, the longest unused first. Never
forgotten: what is pinned, what is being computed, what was made or used within --grace, and
with --unused the newest --last results of each scene's step."""


def configure(action: str, parser: argparse.ArgumentParser) -> None:
    """Add the options of ``gc`` and ``compact``."""
    if action == "compact":
        return
    parser.description = _GC
    keep = Keep()
    parser.add_argument(
        "--quota",
        type=_checked(parse_bytes),
        metavar="SIZE",
        help="forget results until the store takes at most SIZE, e.g. 50GB (default:"
        " $GARDEN_STORE_QUOTA, else no limit)",
    )
    parser.add_argument(
        "--unused",
        type=_checked(parse_seconds),
        metavar="TIME",
        help="forget results that nobody used for TIME, e.g. 30d",
    )
    parser.add_argument(
        "--last",
        type=int,
        default=keep.last,
        metavar="N",
        help="with --unused: keep the newest N of each scene's step however old (1)",
    )
    parser.add_argument(
        "--grace",
        type=_checked(parse_seconds),
        default="24h",
        metavar="TIME",
        help="forget nothing that was made or used within TIME (24h)",
    )
    parser.add_argument("--dry-run", action="store_true", help="only tell what would go")


def run(options: argparse.Namespace) -> int:
    """Run the action; return the exit code."""
    store = open_store(options, create=False)
    return _compact(options, store) if options.action == "compact" else _collect(options, store)


def _compact(options: argparse.Namespace, store: Store) -> int:
    rows = store.compact()
    if options.json:
        print_json({"store": store.address, "rows": rows})
    else:
        print(f"{rows} rows in one file in {store.address}")
    return EXIT_OK


def _collect(options: argparse.Namespace, store: Store) -> int:
    quota = configured_quota() if options.quota is None else options.quota
    done = store.collect(
        quota_bytes=quota,
        grace_s=options.grace,
        keep=dataclasses.replace(Keep(), unused_s=options.unused, last=options.last),
        dry_run=options.dry_run,
    )
    over = 0 if quota is None else max(0, done.bytes_left - quota)
    if options.json:
        document = dataclasses.asdict(done)
        print_json({"store": store.address, "quota_bytes": quota, "over_bytes": over, **document})
    else:
        _tell(done, over, store.address)
    return EXIT_FAILED if over else EXIT_OK


def _tell(done: Collected, over: int, address: str) -> None:
    for one in done.forgotten[:_SHOWN]:
        name = f"{one.step}[{one.label}]" if one.label else one.step
        print(f"{one.scene:<20} {name:<30} {show_bytes(one.bytes):>8}  {one.why}")
    if len(done.forgotten) > _SHOWN:
        print(f"and {len(done.forgotten) - _SHOWN} more (all with --json)")
    would = "would be " if done.dry_run else ""
    print(
        f"{len(done.forgotten)} results {would}forgotten, {done.objects} objects {would}removed:"
        f" {show_bytes(done.freed_bytes)} freed, {show_bytes(done.bytes_left)} left in {address}"
    )
    if over:
        print(
            f"still {show_bytes(over)} over the quota: the rest is pinned, being computed or was"
            " used just now; see `garden store pins`, or give a shorter --grace"
        )


def _checked(parse: Callable[[str], float]) -> Callable[[str], float]:
    def checked(text: str) -> float:
        try:
            return parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return checked
