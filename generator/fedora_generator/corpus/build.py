"""Making a corpus file by file, each complete or absent, and the manifest last."""

import shutil
import signal
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from fedora_generator.choices import STREAMS
from fedora_generator.corpus.ladders import start_span_s
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
from fedora_generator.errors import GeneratorError, OutputError
from fedora_generator.faults import FaultError, plant_fault
from fedora_generator.generate import Request, generate_sequence, require_free_flight
from fedora_generator.rates import whole_us
from fedora_generator.resources import expected_bytes, require_disk_space, require_memory
from fedora_generator.scene import Scene
from fedora_generator.write import generator_version

_STEPS_PREFIX: Final = ".between-"

Report = Callable[[int, int, str], None]
"""Called with the number of files that are done, of those planned, and the name of a file."""


def build_corpus(
    folder: Path,
    options: CorpusOptions,
    scenes: tuple[Scene, ...],
    *,
    jobs: int = 1,
    force: bool = False,
    report: Report = lambda *_: None,
) -> Path:
    """Write a corpus into a folder and return the path of its manifest.

    Complete files of an earlier run with the same arguments are kept. The same arguments give the same bytes of every
    file and of the manifest, with any number of jobs.

    Parameters
    ----------
    folder
        Where the corpus is written.
    scenes
        Scenes of the clean sequences.
    jobs
        Files that are made at once, each by a process of its own; 1: by this process.
    force
        Whether the folder may hold something else.
    report
        Called with each file, before it is made or, with several jobs, when it is complete.

    Raises
    ------
    FaultError
        A cause that cannot be planted.
    SceneError
        A flight meets its world, or the duration is impossible, or the size does not fit the memory.
    OutputError
        The folder holds something else and ``force`` is false, or the disk has too little room.
    GeneratorError
        A process ended abruptly. Files that were complete remain.
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
    maker = _FileMaker(folder, options, {scene.name: scene for scene in scenes}, earlier)
    listing = _Listing(folder, plan, made_with, earlier)
    # A fault is planted in a clean file, and a stream of another sequence comes from one.
    for part in ([file for file in plan if file.base is None], [file for file in plan if file.base is not None]):
        for planned, made in _in_turn(maker, part, listing, jobs, report):
            listing.add(planned, made)
            if planned.base is None:
                sizes[planned.scene] = (folder / planned.file).stat().st_size
                _require_disk_space(folder, missing_bytes(listing.missing(), sizes, earlier))
    report(len(plan), len(plan), MANIFEST)
    return listing.finish()


def _require_disk_space(folder: Path, needed_bytes: int) -> None:
    remedy = "ask for fewer causes, rungs or scenes, or a smaller size"
    require_disk_space(folder, needed_bytes, "the corpus", remedy)


def missing_bytes(plan: Sequence[PlannedFile], sizes: dict[str, int], earlier: dict[str, Item]) -> int:
    """Return the bytes of the planned files that an earlier run has not made."""
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


@dataclass(frozen=True, slots=True)
class _Skipped:
    """A fault that the data could not hold."""

    reason: str


@dataclass(frozen=True, slots=True)
class _FileMaker:
    """What making any file of a corpus needs; it travels to the processes that make files."""

    folder: Path
    options: CorpusOptions
    scenes: dict[str, Scene]
    earlier: dict[str, Item]

    def earlier_item(self, planned: PlannedFile) -> Item | None:
        """Return the item of a file that an earlier run has completed as planned; None without one."""
        item = self.earlier.get(planned.file)
        return item if is_complete(planned, self.folder / planned.file, item) else None

    def make(self, planned: PlannedFile, clean_sha256: str) -> Item | _Skipped:
        """Make one file, unless it exists as planned, and return its item.

        Parameters
        ----------
        clean_sha256
            Digest of the clean file that its faults are planted in; empty for a clean one.
        """
        if (earlier_item := self.earlier_item(planned)) is not None:
            return earlier_item
        path = self.folder / planned.file
        path.unlink(missing_ok=True)
        path.parent.mkdir(exist_ok=True)
        try:
            if planned.base is None:
                request = Request(duration_s=self.options.duration_s, quality=self.options.quality)
                scene = replace(self.scenes[planned.scene], seed=planned.seed)
                if planned.start_s is not None:
                    scene = scene.starting_at(planned.start_s)
                generate_sequence(scene, path, request, overwrite=True)
            else:
                plant_together(self.folder / planned.base, path, planned.faults, self.folder)
                if digest_of(path) == clean_sha256:
                    path.unlink()
                    raise FaultError(
                        "Expected a fault that changes the file, got one that changes nothing in this sequence"
                    )
        except FaultError as error:
            # The folder's own path is left out, so that the manifest is the same wherever the corpus lies.
            return _Skipped(str(error).replace(f"{self.folder}/", ""))
        return item_of(planned, path)


class _Listing:
    """The manifest of a corpus that is being made."""

    def __init__(self, folder: Path, plan: tuple[PlannedFile, ...], made_with: Item, earlier: dict[str, Item]) -> None:
        self._folder = folder
        self._plan = plan
        self._made_with = made_with
        self._earlier = earlier
        self._made: dict[str, Item | _Skipped] = {}
        for steps_of_a_killed_run in folder.glob(f"*/{_STEPS_PREFIX}*"):
            shutil.rmtree(steps_of_a_killed_run)
        self._write(PROGRESS, earlier)  # before the manifest goes, so that an interrupt loses neither
        (folder / MANIFEST).unlink(missing_ok=True)

    @property
    def done(self) -> int:
        """Number of files that were made or skipped."""
        return len(self._made)

    def missing(self) -> list[PlannedFile]:
        """Return the planned files that were neither made nor skipped."""
        return [planned for planned in self._plan if planned.file not in self._made]

    def clean_sha256(self, planned: PlannedFile) -> str:
        """Return the digest of the clean file that faults are planted in; empty for a clean one."""
        made = self._made[planned.base] if planned.base is not None else {"sha256": ""}
        return "" if isinstance(made, _Skipped) else str(made["sha256"])

    def add(self, planned: PlannedFile, made: Item | _Skipped) -> None:
        """Add a file."""
        self._made[planned.file] = made
        self._write(PROGRESS, self._earlier)

    def finish(self) -> Path:
        """Write the manifest, which completes the corpus, and return its path."""
        path = self._folder / MANIFEST
        self._write(MANIFEST, {})
        (self._folder / PROGRESS).unlink(missing_ok=True)
        return path

    def _write(self, name: str, earlier: dict[str, Item]) -> None:
        # In the order of the plan, in whatever order processes end.
        made = {planned.file: self._made[planned.file] for planned in self._plan if planned.file in self._made}
        items = earlier | {file: item for file, item in made.items() if not isinstance(item, _Skipped)}
        skipped = [{"file": file, "reason": item.reason} for file, item in made.items() if isinstance(item, _Skipped)]
        write_listing(self._folder / name, self._made_with, items.values(), skipped)


def _in_turn(
    maker: _FileMaker, files: Sequence[PlannedFile], listing: _Listing, jobs: int, report: Report
) -> Iterator[tuple[PlannedFile, Item | _Skipped]]:
    """Make files that do not need each other, and yield each as it is complete.

    Raises
    ------
    GeneratorError
        A process ended abruptly.
    """
    total = listing.done + len(listing.missing())
    if jobs == 1:
        for planned in files:
            report(listing.done, total, planned.file)
            yield planned, maker.make(planned, listing.clean_sha256(planned))
        return
    missing = []
    for planned in files:
        if (item := maker.earlier_item(planned)) is None:
            missing.append(planned)
        else:
            yield planned, item
    if not missing:
        return
    maker = replace(maker, earlier={})  # it travels with each file, and no earlier run has made these
    # This process handles the interrupt: no further file is begun, and those that are being made are completed.
    ignore = (signal.SIGINT, signal.SIG_IGN)
    with ProcessPoolExecutor(jobs, get_context("spawn"), initializer=signal.signal, initargs=ignore) as pool:
        try:
            work = {pool.submit(maker.make, planned, listing.clean_sha256(planned)): planned for planned in missing}
            for complete in as_completed(work):
                report(listing.done, total, work[complete].file)
                yield work[complete], complete.result()
        except BrokenProcessPool:
            raise GeneratorError(
                "Expected every process to end by itself, one ended abruptly (out of memory?); "
                "run again, with fewer --jobs, to go on where it was"
            ) from None
        finally:
            pool.shutdown(cancel_futures=True)


def plant_together(base: Path, target: Path, faults: tuple[PlannedFault, ...], donors: Path) -> None:
    """Plant faults one after the other, and keep only the file with all of them.

    Parameters
    ----------
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
