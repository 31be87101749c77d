"""Write a scene's package after a run, or refresh its report after a rerun without work."""

from __future__ import annotations

import json
from pathlib import Path

from flows.package.build import dump_json, package_files, timings_parquet
from flows.report.document import Json, run_section
from flows.report.page import with_steps_of
from flows.report.values import load_values
from flows.scene_run import SceneResult, package_key
from storage import Store
from storage.formats.package import update_package, write_package
from tasks.step import RunContext, run_context


def write_scene_package(result: SceneResult, store: Store) -> Json:
    """Write OUT/NAME from the artifacts in the store; return the report."""
    with run_context(RunContext(store=store, scene=result.request.name, engine="local")):
        files, document = package_files(load_values(result))
    write_package(result.request.package, files, package_key(result))
    return document


def refresh_report(result: SceneResult) -> Json:
    """Say in an up-to-date package that this run found everything; return the report."""
    folder: Path = result.request.package
    document: Json = json.loads((folder / "report.json").read_bytes())
    document |= run_section(result)
    page = with_steps_of((folder / "report.html").read_text("utf-8"), document)
    update_package(
        folder,
        {
            "report.json": dump_json(document),
            "report.html": page.encode(),
            "timings.parquet": timings_parquet(document),
        },
    )
    return document
