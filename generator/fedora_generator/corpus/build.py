"""Making a corpus file by file, each complete or absent, and the manifest last."""

import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from fedora_generator.choices import STREAMS
from fedora_generator.corpus.manifest import (
    MANIFEST,
    PROGRESS,
    Item,
    digest_of,
    is_complete,
    item_of,
    read_listing,
    write_listing,
)
from fedora_generator.corpus.plan import CorpusOptions, PlannedFault, PlannedFile, plan_corpus
from fedora_generator.corpus.spread import start_span_s
from fedora_generator.disk_space import expected_bytes, require_disk_space
from fedora_generator.errors import OutputError
from fedora_generator.faults import FaultError, plant_fault
from fedora_generator.generate import Request, generate_sequence, require_free_flight
from fedora_generator.instants import whole_us
from fedora_generator.memory import require_memory
from fedora_generator.metadata import generator_version
from fedora_generator.scene import Scene

_STEPS_PREFIX: Final = ".between-"

Report = Callable[[int, int, str], None]
"""Called with the number of files that are done, of those planned, and the name of the next."""


def build_corpus(
    folder: Path,
    options: CorpusOptions,
    scenes: tuple[Scene, ...],
    *,
    force: bool = False,
    report: Report = lambda *_: None,
) -> Path:
    """Write a corpus into a folder and return the path of its manifest.

    Complete files of an earlier run with the same arguments are kept. The same arguments give the same bytes of every
    file and of the manifest.

    Parameters
    ----------
    folder
        Where the corpus is written.
    options
        Which files it holds.
    scenes
        Scenes of the clean sequences.
    force
        Whether the folder may hold something else.
    report
        Called before each file.

    Raises
    ------
    FaultError
        A cause that cannot be planted.
    SceneError
        A flight meets its world, or the duration is impossible, or the size does not fit the memory.
    OutputError
        The folder holds something else and ``force`` is false, or the disk has too little room.
    """
    plan = plan_corpus(options, scenes)
    made_with = _made_with(options, scenes)
    earlier = _earlier_items(folder, made_with, force=force)
    for scene in scenes:
        require_memory(scene, frozenset(STREAMS))
        start_span = start_span_s(scene, options.duration_s) if options.spread else 0.0
        require_free_flight(scene, whole_us(start_span + options.duration_s))
    sizes = {scene.name: expected_bytes(scene, options.duration_s) for scene in scenes}
    _require_disk_space(folder, missing_bytes(plan, sizes, earlier))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Expected to be able to make the folder {folder}, got: {error.strerror}") from error
    writer = _CorpusWriter(folder, options, {scene.name: scene for scene in scenes}, made_with, earlier)
    for done, planned in enumerate(plan):
        report(done, len(plan), planned.file)
        writer.make(planned)
        if planned.base is None:
            sizes[planned.scene] = (folder / planned.file).stat().st_size
            _require_disk_space(folder, missing_bytes(plan[done + 1 :], sizes, earlier))
    report(len(plan), len(plan), MANIFEST)
    return writer.finish()


def _require_disk_space(folder: Path, needed_bytes: int) -> None:
    remedy = "ask for fewer causes, rungs or scenes, or a smaller size"
    require_disk_space(folder, needed_bytes, "the corpus", remedy)


def missing_bytes(plan: tuple[PlannedFile, ...], sizes: dict[str, int], earlier: dict[str, Item]) -> int:
    """Bytes of the planned files that an earlier run has not made.

    Parameters
    ----------
    plan
        Files of the corpus.
    sizes
        Bytes of a sequence, by scene.
    earlier
        Items of an earlier run, by file.
    """
    missing = Counter(planned.scene for planned in plan if planned.file not in earlier)
    return sum(count * sizes[scene] for scene, count in missing.items())


def _made_with(options: CorpusOptions, scenes: tuple[Scene, ...]) -> Item:
    """Return what every file depends on besides its own item."""
    camera = scenes[0].camera
    return {
        "generator": generator_version(),
        "scenes": {scene.name: scene.digest for scene in scenes},
        "size": [camera.width, camera.height],
        "duration_s": options.duration_s,
        "quality": options.quality,
    }


def _earlier_items(folder: Path, made_with: Item, *, force: bool) -> dict[str, Item]:
    """Return the items of an earlier run with the same arguments, by file.

    Raises
    ------
    OutputError
        The folder is a file, or holds something else and ``force`` is false.
    """
    if not folder.exists():
        return {}
    if not folder.is_dir():
        raise OutputError(f"Expected a folder to write the corpus into, got the file {folder}")
    listing = read_listing(folder)
    if listing is not None and listing["made_with"] == made_with:
        return {item["file"]: item for item in listing["items"]}
    if any(folder.iterdir()) and not force:
        got = "a corpus of other scenes, size, duration or quality" if listing else "other files"
        raise OutputError(f"Expected an empty folder, or this corpus begun, got {got} in {folder}; use --force")
    return {}


class _CorpusWriter:
    """A corpus being made."""

    def __init__(
        self, folder: Path, options: CorpusOptions, scenes: dict[str, Scene], made_with: Item, earlier: dict[str, Item]
    ) -> None:
        self._folder = folder
        self._options = options
        self._scenes = scenes
        self._made_with = made_with
        self._earlier = earlier
        self._items: dict[str, Item] = {}
        self._skipped: list[Item] = []
        for steps_of_a_killed_run in folder.glob(f"*/{_STEPS_PREFIX}*"):
            shutil.rmtree(steps_of_a_killed_run)
        self._list(PROGRESS)  # before the manifest goes, so that an interrupt loses neither
        (folder / MANIFEST).unlink(missing_ok=True)

    def make(self, planned: PlannedFile) -> None:
        """Make one file, unless it exists as planned; a fault that cannot be planted is skipped."""
        path, earlier_item = self._folder / planned.file, self._earlier.get(planned.file)
        if is_complete(planned, path, earlier_item):
            self._items[planned.file] = dict(earlier_item or {})
            return
        path.unlink(missing_ok=True)
        path.parent.mkdir(exist_ok=True)
        try:
            if planned.base is None:
                request = Request(duration_s=self._options.duration_s, quality=self._options.quality)
                scene = replace(self._scenes[planned.scene], seed=planned.seed)
                if planned.start_s is not None:
                    scene = scene.starting_at(planned.start_s)
                generate_sequence(scene, path, request, overwrite=True)
            else:
                plant_together(self._folder / planned.base, path, planned.faults, self._folder)
                if digest_of(path) == self._items[planned.base]["sha256"]:
                    path.unlink()
                    raise FaultError(
                        "Expected a fault that changes the file, got one that changes nothing in this sequence"
                    )
        except FaultError as error:
            # The folder's own path is left out, so that the manifest is the same wherever the corpus lies.
            reason = str(error).replace(f"{self._folder}/", "")
            self._skipped.append({"file": planned.file, "reason": reason})
            return
        self._items[planned.file] = item_of(planned, path)
        self._list(PROGRESS)

    def finish(self) -> Path:
        """Write the manifest, which completes the corpus, and return its path."""
        path = self._folder / MANIFEST
        self._earlier = {}
        self._list(MANIFEST)
        (self._folder / PROGRESS).unlink(missing_ok=True)
        return path

    def _list(self, name: str) -> None:
        items = self._earlier | self._items
        write_listing(self._folder / name, self._made_with, items.values(), self._skipped)


def plant_together(base: Path, target: Path, faults: tuple[PlannedFault, ...], donors: Path) -> None:
    """Plant faults one after the other, and keep only the file with all of them.

    Parameters
    ----------
    base
        The clean file.
    target
        The file with all faults.
    faults
        In the order in which they are planted.
    donors
        Folder that the donors of the faults are in.

    Raises
    ------
    FaultError
        One of them cannot be planted; nothing is written.
    """
    with TemporaryDirectory(dir=target.parent, prefix=_STEPS_PREFIX) as steps:
        source = base
        for index, fault in enumerate(faults):
            last = index == len(faults) - 1
            step = target if last else Path(steps) / f"{index}.h5"
            plant_fault(
                source,
                step,
                fault.cause,
                fault.stream,
                magnitude=fault.magnitude,
                unit=fault.unit,
                seed=fault.seed,
                start_s=fault.start_s,
                stop_s=fault.stop_s,
                region=fault.region,
                direction_deg=fault.direction_deg,
                donor=None if fault.donor is None else donors / fault.donor,
            )
            source = step
