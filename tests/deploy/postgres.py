"""A PostgreSQL server for a test: the machine's own, or Debian's packages in a folder.

Nothing is installed into the system: the packages are downloaded and unpacked where the test
says, and the server runs from there, as a user without rights.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import pwd
import re
import secrets
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import asyncpg
import pytest

from tests.deploy.conftest import background, free_port, wait_for

OLDEST = 14
"""Prefect needs PostgreSQL 14.9 with the extension pg_trgm."""


@dataclass(frozen=True)
class Installation:
    """The folder of PostgreSQL's programs, and of libraries that they need beside the system's."""

    programs: Path
    libraries: Path | None = None

    def environment(self) -> dict[str, str]:
        libraries = {"LD_LIBRARY_PATH": str(self.libraries)} if self.libraries else {}
        return {"PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8", **libraries}

    def run(self, program: str, *arguments: str) -> str:
        done = subprocess.run(
            [str(self.programs / program), *arguments],
            env=self.environment(), capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()


@dataclass(frozen=True)
class Database:
    """A running server with one empty database, and who may use it."""

    port: int
    password: str
    user: str = "prefect"
    name: str = "prefect"


def installation(folder: Path) -> Installation:
    """Return PostgreSQL as it is installed here, or unpack it into ``folder``.

    Skips the test where neither is possible, and says what would make it so.
    """
    found = installed() or unpacked(folder)
    if found is None:
        reason = (
            f"needs PostgreSQL {OLDEST} or newer with pg_trgm: install it, or run this on Debian or"
            " Ubuntu, where it is downloaded for the test (after an 'apt-get update')"
        )
        pytest.skip(reason)
    return found


def installed() -> Installation | None:
    """Return the newest installation of this machine that Prefect can use."""
    known = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=_number, reverse=True)
    on_path = shutil.which("postgres")
    programs = [*known, *([Path(on_path).resolve().parent] if on_path else [])]
    return next((i for i in map(Installation, programs) if _is_usable(i)), None)


def unpacked(folder: Path) -> Installation | None:
    """Download Debian's packages and what they need here, and unpack them into ``folder``."""
    if not shutil.which("apt-get") or not shutil.which("dpkg-deb"):
        return None
    if not _apt("apt-cache", "depends", "postgresql") and os.geteuid() == 0:
        _apt("apt-get", "-qq", "update")
    server = re.search(r"Depends: (postgresql-\d+)", _apt("apt-cache", "depends", "postgresql"))
    if not server:
        return None
    simulation = _apt("apt-get", "-s", "install", "--no-install-recommends", server[1])
    needed = {server[1], *re.findall(r"^Inst (\S+)", simulation, re.MULTILINE)}
    folder.mkdir()
    if subprocess.run(["apt-get", "-qq", "download", *needed], cwd=folder, check=False).returncode:
        return None
    root = folder / "root"
    for package in folder.glob("*.deb"):
        subprocess.run(["dpkg-deb", "-x", str(package), str(root)], check=True)
    [programs] = root.glob("usr/lib/postgresql/*/bin")
    libraries = next(iter(root.glob("usr/lib/*-linux-gnu*")), None)
    return Installation(programs, libraries)


@contextlib.contextmanager
def database(folder: Path) -> Iterator[Database]:
    """Run a server in ``folder`` on a free loopback port until the block ends."""
    found = installation(folder / "packages")
    data, password = folder / "data", secrets.token_urlsafe(16)
    secret = folder / "password"
    secret.write_text(password)
    data.mkdir()
    prefix = _without_rights(folder, data, secret)
    here = Database(free_port(), password)
    initdb = [
        str(found.programs / "initdb"), "--pgdata", str(data), "--username", here.user,
        "--pwfile", str(secret), "--auth", "scram-sha-256", "--no-sync",
    ]  # fmt: skip
    done = subprocess.run(
        [*prefix, *initdb], env=found.environment(), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    server = [
        str(found.programs / "postgres"), "-D", str(data), "-p", str(here.port),
        "-c", "listen_addresses=127.0.0.1", "-c", "unix_socket_directories=", "-c", "fsync=off",
    ]  # fmt: skip
    log = folder / "postgres.log"
    with background([*prefix, *server], found.environment(), log) as process:

        def is_ready() -> bool:
            assert process.poll() is None, log.read_text()
            with contextlib.suppress(OSError, asyncpg.PostgresError):
                return bool(query(here, "SELECT 1", "postgres"))
            return False

        wait_for("PostgreSQL", is_ready, 60)
        query(here, f"CREATE DATABASE {here.name}", "postgres")
        yield here


def query(server: Database, sql: str, name: str | None = None) -> list[tuple[object, ...]]:
    """Run one statement; give its rows."""

    async def ask() -> list[tuple[object, ...]]:
        connection = await asyncpg.connect(
            host="127.0.0.1", port=server.port, user=server.user, password=server.password,
            database=name or server.name,
        )  # fmt: skip
        try:
            return [tuple(row) for row in await connection.fetch(sql)]
        finally:
            await connection.close()

    return asyncio.run(ask())


def _number(programs: Path) -> int:
    return int(programs.parent.name) if programs.parent.name.isdigit() else 0


def _is_usable(found: Installation) -> bool:
    if not (found.programs / "initdb").exists():
        return False
    version = re.search(r"(\d+)", found.run("postgres", "--version"))
    share = Path(found.run("pg_config", "--sharedir")) if _has(found, "pg_config") else None
    extensions = share or Path("/usr/share/postgresql") / found.programs.parent.name
    has_trgm = (extensions / "extension" / "pg_trgm.control").exists()
    return bool(version) and int(version[1]) >= OLDEST and has_trgm


def _has(found: Installation, program: str) -> bool:
    return (found.programs / program).exists()


def _apt(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout


def _without_rights(folder: Path, *owned: Path) -> list[str]:
    """Return what runs a command as a user who may own a database: the root user may not."""
    if os.geteuid() != 0:
        return []
    nobody = pwd.getpwnam("nobody")
    for path in owned:
        os.chown(path, nobody.pw_uid, nobody.pw_gid)
    for parent in [folder, *folder.parents]:
        if parent.stat().st_uid == 0 and parent.stat().st_mode & 0o005 != 0o005:
            parent.chmod(parent.stat().st_mode | 0o005)
    ids = [f"--reuid={nobody.pw_uid}", f"--regid={nobody.pw_gid}", "--clear-groups"]
    return ["setpriv", *ids]
