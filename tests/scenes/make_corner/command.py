"""The command that makes the capture."""

from __future__ import annotations

import argparse
import importlib.util
import shutil
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from . import cameras, render, room, truth

EXPOSURE = 1.45  # photos per unit of linear light, fixed so that the photos agree
JPEG_QUALITY = 84

README = """# corner: a sample capture with its truth

{count} photos ({width}x{height}) of the corner of a room: a table with a toy house, a decoy
duck that touches the house, and a lidded jar. Path traced; every texture and mesh is made by
`tests/scenes/make_corner` (`pip install mitsuba`, then `python tests/scenes/make_corner`),
so the folder is under the project's licence, Apache-2.0.

- `images/`, `targets.json`: what a user would give. Nothing else may be read by a step.
- `truth/cameras.json`: exact cameras (OpenCV camera-to-world), the direction up, the unit of
  the depth maps; `truth/transforms.json`: the same cameras in nerfstudio's form, in the same
  metric world, for runs with given cameras. The world's axes are turned at random.
- `truth/depth/`: z-depth of a few photos, 0.1 mm, half size (`depth_K`).
- `truth/masks/OBJECT/PHOTO.png`: visible pixels, 1 bit.
- `truth/objects.json`, `truth/objects/*.npz`: closed meshes in upright object frames (y down,
  origin on the support), `world_from_object`, symmetry, visibility, supports.
- `truth/room.npz`: room and furniture as triangles, in the world.

`flows/benchmark/corner_truth.py` reads it all into typed arrays.
"""


def main(arguments: list[str] | None = None) -> int:
    """Make the capture; return the exit status."""
    here = Path(__file__).resolve().parent
    parser = argparse.ArgumentParser(prog="make_corner", description=__doc__)
    parser.add_argument("--out", type=Path, default=here.parent / "corner", help="folder to write")
    parser.add_argument("--spp", type=int, default=16, help="light paths a pixel (default 16)")
    parser.add_argument("--preview", action="store_true", help="4 paths a pixel, coarse textures")
    parser.add_argument("--sheet", type=Path, help="also write a contact sheet (PNG) there")
    parser.add_argument("--variant", help="Mitsuba variant (default: the fastest that works)")
    options = parser.parse_args(arguments)

    if importlib.util.find_spec("mitsuba") is None:
        parser.error("mitsuba is missing: pip install mitsuba (the extra 'sample')")
    variant = options.variant or render.choose_variant()
    import mitsuba as mi

    mi.set_variant(variant)
    started = time.monotonic()

    def say(what: str) -> None:
        print(f"{time.monotonic() - started:7.1f} s  {what}", flush=True)

    say(f"Mitsuba {mi.__version__}, {variant}: textures and meshes")
    placed, quads, shots = room.objects(), room.quads(), cameras.shots()
    tracer = render.Tracer(placed, quads, room.pictures(2.5 if options.preview else 1.0))
    folder: Path = options.out
    for old in ("images", "truth"):
        shutil.rmtree(folder / old, ignore_errors=True)
    say("truth")
    truth.write_cameras(folder / "truth", shots)
    seen = truth.write_views(folder / "truth", tracer, shots)
    truth.write_objects(folder / "truth", placed, quads, seen)
    truth.write_targets(folder / "targets.json", seen)
    size = {"count": len(shots), "width": cameras.WIDTH, "height": cameras.HEIGHT}
    (folder / "README.md").write_text(README.format(**size), encoding="utf-8")

    (folder / "images").mkdir(parents=True)
    small = []
    for number, shot in enumerate(shots):
        light = tracer.photo(shot, 4 if options.preview else options.spp, seed=number)
        image = render.srgb8(light, EXPOSURE)
        mi.Bitmap(image).write(str(folder / "images" / shot.photo), quality=JPEG_QUALITY)
        small.append(image[::2, ::2])
        say(f"{shot.photo}  median {np.median(image):.0f}, white {np.mean(image > 250):.3f}")
    if options.sheet:
        mi.Bitmap(sheet(small)).write(str(options.sheet))
    total = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    say(f"{folder}: {total / 1e6:.2f} MB")
    return 0


def sheet(images: list[NDArray[np.uint8]], columns: int = 6) -> NDArray[np.uint8]:
    """Return all photos in one picture, ``columns`` a row."""
    blank = np.zeros_like(images[0])
    padded = images + [blank] * (-len(images) % columns)
    rows = [np.hstack(padded[i : i + columns]) for i in range(0, len(padded), columns)]
    return np.ascontiguousarray(np.vstack(rows))
