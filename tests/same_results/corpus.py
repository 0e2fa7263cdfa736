"""The files that the code of two commits is run on: clean, faulty, large, broken and hostile ones."""

import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import h5py

from fedora_generator.choices import SCENE_NAMES
from fedora_generator.corpus.build import build_corpus
from fedora_generator.corpus.plan import CorpusOptions
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from tests.hostile.test_files import CONTENTS, HARMLESS, LINKS, PATCHED, STORAGE
from tests.integration.test_broken_input import BROKEN
from tests.support.handmade import write_handmade

SMALL: Final = (180, 136)
LARGE: Final = (720, 540)
"""Frames of more pixels than those from which on a check takes a part of a field."""

FAULT_SCENES: Final = ("park-day", "fast-turn", "racetrack", "park-noisy")
FAULTS: Final = CorpusOptions(clean=1, ladder=2, duration_s=0.5)
LARGE_SCENES: Final = ("park-day", "park-noisy")
LARGE_FAULTS: Final = CorpusOptions(
    clean=1,
    ladder=1,
    duration_s=0.4,
    causes=("flow_gain", "events:time_offset", "depth:spatial_offset", "swapped_frames", "depth:unit_mm_m"),
)
COMPLETE: Final = ".complete"


def make_corpus(folder: Path, report: Callable[[str], None]) -> None:
    """Write all files below a folder, one folder a kind; kinds that are complete are kept."""
    makers: Mapping[str, Callable[[Path], None]] = {
        "clean": _make_clean,
        "faults": lambda target: _make_faults(target, FAULTS, FAULT_SCENES, SMALL),
        "large": lambda target: _make_faults(target, LARGE_FAULTS, LARGE_SCENES, LARGE),
        "broken": lambda target: _make_broken(target, folder / "clean" / "park-day.h5"),
        "hostile": _make_hostile,
    }
    for kind, make in makers.items():
        target = folder / kind
        if (target / COMPLETE).exists():
            continue
        report(f"making {target}")
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir(parents=True)
        make(target)
        (target / COMPLETE).touch()


def corpus_files(folder: Path, every: int = 1) -> Iterator[Path]:
    """Yield the files in a fixed order; of the faulty ones of small frames every so-manieth only."""
    for kind in ("clean", "faults", "large", "broken", "hostile"):
        files = sorted(path for path in (folder / kind).rglob("*.h5") if path.is_file())
        yield from files[:: every if kind == "faults" else 1]


def _make_clean(target: Path) -> None:
    for name in SCENE_NAMES:
        request = Request(duration_s=0.5, quality="draft")
        generate_sequence(load_scene(name).with_size(*SMALL), target / f"{name}.h5", request)


def _make_faults(target: Path, options: CorpusOptions, names: tuple[str, ...], size: tuple[int, int]) -> None:
    scenes = tuple(load_scene(name).with_size(*size) for name in names)
    build_corpus(target, replace(options, quality="draft"), scenes, force=True)


def _make_broken(target: Path, clean: Path) -> None:
    for name, (mutate, _, _) in BROKEN.items():
        mutate(clean, target / f"{name.replace(' ', '_')}.h5")


def _make_hostile(target: Path) -> None:
    clean = write_handmade(target / "clean.h5")
    for edit in (*STORAGE, *LINKS, *CONTENTS, *HARMLESS):
        path = target / f"{edit.__name__}.h5"
        shutil.copy(clean, path)
        with h5py.File(path, "r+") as file:
            edit(file)
    for patch in PATCHED:
        path = target / f"{patch.__name__}.h5"
        shutil.copy(clean, path)
        patch(path)
