"""Turn what was measured of steps, publishing and a scene into tables and claims."""

from __future__ import annotations

from statistics import median

from flows.benchmark.measure import Measure
from flows.benchmark.orchestration.peers.all_peers import JOBLIB, PLAIN, STEPS
from flows.benchmark.orchestration.publishing import Throughput
from flows.benchmark.orchestration.report import Row, Section
from flows.benchmark.orchestration.scene_overhead import SceneOverhead
from flows.benchmark.orchestration.step_cost import StepCost

HIT_OF_JOBLIBS = 0.2
PUBLISHED_PERCENT = 80.0
ORCHESTRATION_PERCENT = 3.0

STEPS_METHOD = """\
Milliseconds a step, medians over repeats in turns on one machine, each from an empty cache:
the first pass misses every step, the next ones hit every step. All give the same values and
run the same functions; that a hit ran nothing is checked. "placement" is the small artifact
that the pipeline has most of (13 poses with their scores), "array" one array of 4 KB. Every
chain hands each step's result to the next, so that what loads values hashes them again.
Prefect's figures are taken inside one flow run; the CPU time of its server is beside."""

PUBLISHING_METHOD = """\
MB/s of arrays (depth, colours, points), medians. Plain is Zarr's own local store with the
same chunks, shards and codecs, every file and folder made durable, without digests and
manifest."""

SCENE_METHOD = """\
One cold scene as a Prefect flow, from an empty store. Overhead is the share of its
wall-clock time in which no step's function ran or loaded its inputs: Prefect, keys, look-ups,
waiting, and publishing that no other step's work hid. The strict figure counts loading as
overhead too. Starting a server comes once a process and is told apart."""


def step_section(chain: str, length: int, costs: list[StepCost]) -> Section:
    """Return the table of one chain; for placements also what a hit may cost."""
    by_name = {cost.peer: cost for cost in costs}
    rows = [_step_row(cost, by_name) for cost in costs]
    claims: tuple[Measure, ...] = ()
    if chain == "placement" and {STEPS, JOBLIB} <= by_name.keys():
        ratio = by_name[STEPS].hit_ms / by_name[JOBLIB].hit_ms
        claims = (
            Measure("verified hit of a small artifact", ratio, HIT_OF_JOBLIBS, "of joblib's"),
        )
    return Section(f"A step: {length} in a chain of {chain}s", STEPS_METHOD, rows, claims)


def _step_row(cost: StepCost, by_name: dict[str, StepCost]) -> Row:
    plain, joblib = by_name.get(PLAIN), by_name.get(JOBLIB)
    server = median(cost.server_ms) if cost.server_ms else None
    return {
        "system": cost.peer,
        "miss ms": round(cost.miss_ms, 4),
        "hit ms": round(cost.hit_ms, 4),
        "server CPU ms": None if server is None else round(server, 1),
        "miss x plain": None if plain is None else round(cost.miss_ms / plain.miss_ms, 1),
        "hit / joblib's": None if joblib is None else round(cost.hit_ms / joblib.hit_ms, 3),
        "a hit gives": cost.note,
    }


def publishing_section(measured: Throughput) -> Section:
    """Return the table and the claim of publishing large arrays."""
    rows: list[Row] = [
        {"way": "published", "MB": measured.megabytes, "MB/s": round(measured.published_mb_s, 1)},
        {"way": "plain Zarr", "MB": measured.megabytes, "MB/s": round(measured.plain_mb_s, 1)},
    ]
    claim = Measure(
        "publishing arrays", measured.share, PUBLISHED_PERCENT, "% of plain Zarr", at_least=True
    )
    return Section("Publishing large arrays", PUBLISHING_METHOD, rows, (claim,))


def scene_section(measured: SceneOverhead) -> Section:
    """Return the table and the claim of a cold scene."""
    row: Row = {
        "scene": measured.scene,
        "steps": measured.steps,
        "wall s": round(measured.wall_s, 2),
        "overhead %": round(measured.overhead, 2),
        "strict %": round(measured.strict_overhead, 2),
        "sum compute s": round(measured.compute_s, 2),
        "sum load s": round(measured.load_s, 2),
        "sum publish s": round(measured.publish_s, 2),
        "sum wait s": round(measured.wait_s, 2),
        "server start s": round(measured.server_start_s, 2),
    }
    claim = Measure(
        "orchestration of a cold scene", measured.overhead, ORCHESTRATION_PERCENT, "% of its time"
    )
    return Section("A cold scene", SCENE_METHOD, [row], (claim,))
