"""Plants every fault in several scenes and counts how often it is found and named: ``make study-causes``.

Writes docs/named-causes.md. Faults have the nominal sizes of the corpus (docs/corpus.md). What was found of a fault is
kept in out/named-causes, so that an interrupted study goes on where it was; ``--fresh`` forgets it.
"""

import json
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import click

from fedora_generator.corpus.build import plant_together
from fedora_generator.corpus.plan import CorpusOptions, PlannedFile, plan_corpus
from fedora_generator.faults import FaultError
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import Scene, load_scene
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file

ROOT: Final = Path(__file__).parents[2]
TARGET: Final = ROOT / "docs" / "named-causes.md"
KEPT: Final = ROOT / "out" / "named-causes"
SCENES: Final = ("park-day", "park-noisy", "racetrack", "park-night")
SIZE: Final = (270, 200)
OPTIONS: Final = CorpusOptions(clean=1, ladder=1)

HEAD: Final = """\
# Are planted faults detected and named?

Written by `make study-causes`, {date}. {each} is planted in each of {scenes} ({width}x{height} pixels, one second).
It has its nominal size, which a good tool should just detect in so short and small a file ([corpora](corpus.md)).
*Detected*: at least one check failed. *Named first*: the first diagnosis has the right cause and the right stream.

{found} of {of} faults are detected ({found_share:.1%}). {named} of those are named first ({named_share:.1%}).

| faults | planted | detected | named first |
| --- | --- | --- | --- |
"""


@dataclass(frozen=True, slots=True)
class Named:
    """What the diagnosis says of one planted fault; ``diagnoses`` are ``stream:cause``, most probable first."""

    scene: str
    kind: str
    stream: str
    cause: str
    magnitude: float | None
    unit: str
    notes: str
    found: bool
    diagnoses: tuple[str, ...]

    @property
    def truth(self) -> str:
        """``stream:cause`` that was planted."""
        return f"{self.stream}:{self.cause}"

    @property
    def is_first(self) -> bool:
        """Whether the truth is named first."""
        return self.diagnoses[:1] == (self.truth,)


@click.command()
@click.option("--jobs", default=2, show_default=True, help="Processes.")
@click.option("--scenes", default=",".join(SCENES), show_default=True)
@click.option("--every", default=1, show_default=True, help="Plant every so manieth fault of a scene only.")
@click.option("--fresh", is_flag=True, help="Forget what was found before.")
def main(jobs: int, scenes: str, every: int, fresh: bool) -> None:
    """Plant, check, and write docs/named-causes.md."""
    if fresh:
        shutil.rmtree(KEPT, ignore_errors=True)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        work = [
            pool.submit(named, planned, base)
            for scene in scenes.split(",")
            for base in [_clean(load_scene(scene).with_size(*SIZE))]
            for planned in planned_faults(load_scene(scene).with_size(*SIZE))[::every]
        ]
        found = []
        for future in as_completed(work):
            one = future.result()
            if one is not None:
                found.append(one)
                click.echo(f"{len(found)} {_sentence(one)}", err=True)
    text = "".join(page(found, every))
    if scenes == ",".join(SCENES):
        TARGET.write_text(text, encoding="utf-8")
    click.echo(text)


def planned_faults(scene: Scene) -> tuple[PlannedFile, ...]:
    """Return every fault that a good tool should see in the scene: alone, in half of the time, in part of the image."""
    plan = plan_corpus(OPTIONS, (scene,))
    return tuple(one for one in plan if len(one.faults) == 1 and one.observable)


def _clean(scene: Scene) -> Path:
    target = KEPT / f"{scene.name}.h5"
    target.parent.mkdir(parents=True, exist_ok=True)
    if not target.exists():
        generate_sequence(scene, target, Request(duration_s=OPTIONS.duration_s, quality=OPTIONS.quality))
    return target


def named(planned: PlannedFile, base: Path) -> Named | None:
    """Plant a fault in a clean file, check it, and forget it; None where the file cannot hold it."""
    kept = KEPT / Path(planned.file).with_suffix(".json")
    if kept.exists():
        values = json.loads(kept.read_text(encoding="utf-8"))
        return Named(**(values | {"diagnoses": tuple(values["diagnoses"])}))
    kept.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=KEPT) as folder:
        target = Path(folder) / "faulty.h5"
        try:
            plant_together(base, target, planned.faults, KEPT)
        except FaultError:
            return None
        record = check_file(target, CheckOptions(evidence=None)).record
    fault = planned.faults[0]
    one = Named(
        planned.scene,
        Path(planned.file).parts[0],
        fault.stream,
        fault.cause,
        fault.magnitude,
        fault.unit,
        planned.notes,
        record.verdict == "findings",
        tuple(f"{diagnosis.stream}:{diagnosis.cause}" for diagnosis in record.diagnoses),
    )
    kept.write_text(json.dumps(asdict(one)), encoding="utf-8")
    return one


def page(found: Sequence[Named], every: int = 1) -> Iterator[str]:
    """Text of docs/named-causes.md."""
    seen = [one for one in found if one.found]
    first = sum(one.is_first for one in seen)
    yield HEAD.format(
        date=time.strftime("%Y-%m-%d"),
        each="Each fault" if every == 1 else f"One fault in {every} (`--every {every}`)",
        scenes=", ".join(dict.fromkeys(one.scene for one in found)),
        width=SIZE[0],
        height=SIZE[1],
        found=len(seen),
        of=len(found),
        found_share=len(seen) / len(found),
        named=first,
        named_share=first / max(len(seen), 1),
    )
    for title, of in (("whole file", "single"), ("part of it", "local")):
        yield from _rows([one for one in found if one.kind == of], lambda _, title=title: title)
    yield "\n## By scene\n\n| scene | planted | detected | named first |\n| --- | --- | --- | --- |\n"
    yield from _rows(found, lambda one: one.scene)
    yield "\n## By stream\n\n| stream | planted | detected | named first |\n| --- | --- | --- | --- |\n"
    yield from _rows(found, lambda one: one.stream)
    yield "\n## By cause\n\n| cause | planted | detected | named first |\n| --- | --- | --- | --- |\n"
    yield from _rows(found, lambda one: one.cause)
    yield "\n## Faults that are not named first\n\n"
    for one in sorted(found, key=lambda one: (one.truth, one.scene, one.kind)):
        if not one.is_first:
            yield f"- {_sentence(one)}\n"


def _rows(found: Sequence[Named], by: Callable[[Named], str]) -> Iterator[str]:
    for name in dict.fromkeys(sorted(by(one) for one in found)):
        of = [one for one in found if by(one) == name]
        yield f"| {name} | {len(of)} | {sum(one.found for one in of)} | {sum(one.is_first for one in of)} |\n"


def _sentence(one: Named) -> str:
    size = "" if one.magnitude is None else f" {one.magnitude:g} {one.unit}"
    said = ", ".join(one.diagnoses[:3]) or "nothing"
    return f"{one.scene}, {one.truth}{size}{f', {one.notes}' if one.notes else ''}: {said}"


if __name__ == "__main__":
    main()
