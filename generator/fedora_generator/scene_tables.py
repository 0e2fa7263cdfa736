"""Scenes and worlds as tables: where their files lie, what they take from a base, and which values are refused."""

import math
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from fedora_generator.choices import MOST_SEED, SCENE_NAMES, SCENES
from fedora_generator.errors import SceneError
from fedora_generator.flights.choice import resolve_flight
from fedora_qa.errors import did_you_mean

_WORLDS: Final = SCENES / "worlds"

LARGEST: Final = 1e12
"""Largest size of any quantity of a scene, in its unit; its squares and cubes are far from the end of float64."""


def scene_path(name_or_path: str) -> Path:
    """Path of a scene of the package, or of a TOML file.

    Raises
    ------
    SceneError
        There is no such scene.
    """
    if name_or_path in SCENE_NAMES:
        return SCENES / f"{name_or_path}.toml"
    if name_or_path.endswith(".toml") and Path(name_or_path).is_file():
        return Path(name_or_path)
    raise SceneError(
        f"Expected one of the scenes {', '.join(SCENE_NAMES)}, or the path of a TOML file, got {name_or_path!r}"
        f"{did_you_mean(name_or_path, SCENE_NAMES)}"
    )


def read_scene(path: Path, started_from: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Tables of a scene with those of its base and world; the files of ``started_from`` name it as their base.

    Raises
    ------
    SceneError
        Not TOML, no such base or world, or one that starts from itself.
    """
    _require_no_circle(path, started_from)
    tables = _read_toml(path)
    base = tables.pop("base", None)
    if base is not None:
        # A base is a TOML file beside the scene, or else a scene of the package.
        beside = path.parent / str(base)
        base_path = scene_path(str(beside) if beside.is_file() else str(base))
        base_tables = read_scene(base_path, (*started_from, path.resolve()))
        # A place replaces the world of the base and a world its place; a flight replaces a flight of another kind.
        alternatives = {"world": "place", "place": "world"}
        base_tables = {key: value for key, value in base_tables.items() if alternatives.get(key) not in tables}
        base_flight, flight = base_tables.get("flight"), tables.get("flight")
        if isinstance(base_flight, Mapping) and isinstance(flight, Mapping):
            base_kind = base_flight.get("kind")
            if flight.get("kind", base_kind) != base_kind:
                base_tables.pop("flight")
        tables = _merged(base_tables, tables)
    if isinstance(tables.get("world"), str):
        tables["world"] = _read_world(_world_path(tables["world"], beside=path))
    flight = tables.get("flight")
    if isinstance(flight, Mapping):
        tables["flight"] = resolve_flight(flight, path.parent)
    return tables


def impossible_value(tables: Mapping[str, Any]) -> str | None:
    """Return a sentence about the first value that is refused whatever its key, or None.

    Refused are numbers that are not finite or too large, booleans, and text with zero bytes.
    """
    for key, value in _leaves(tables, ""):
        most = MOST_SEED if key.endswith("seed") else LARGEST
        if isinstance(value, bool):
            return f"Expected a number or a text, got {str(value).lower()} at {key}"
        if isinstance(value, int | float) and not (math.isfinite(value) and abs(value) <= most):
            return f"Expected a finite number of at most {most:g}, got {value:g} at {key}"
        if isinstance(value, str) and "\0" in value:
            return f"Expected text without zero bytes, got {value!r} at {key}"
    return None


def _require_no_circle(path: Path, started_from: tuple[Path, ...]) -> None:
    if path.resolve() in started_from:
        raise SceneError(f"Expected a base that starts from something else, got {path.name}, which starts from itself")


def _read_world(path: Path, started_from: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Tables of a world; the solids of its base come first."""
    _require_no_circle(path, started_from)
    tables = _read_toml(path)
    name = tables.pop("base", None)
    if name is None:
        return tables
    base = _read_world(_world_path(str(name), beside=path), (*started_from, path.resolve()))
    solids = {key: [*base.get(key, ()), *tables.get(key, ())] for key in ("rectangles", "boxes", "movers", "lamps")}
    return {**_merged(base, tables), **solids}


def _world_path(name_or_path: str, beside: Path) -> Path:
    packaged, own = _WORLDS / f"{name_or_path}.toml", beside.parent / name_or_path
    for path in (packaged, own):
        if path.is_file():
            return path
    names = ", ".join(sorted(path.stem for path in _WORLDS.glob("*.toml")))
    raise SceneError(f"Expected one of the worlds {names}, or a TOML file beside the scene, got {name_or_path!r}")


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise SceneError(f"Expected a readable TOML file, got {path}: {error}") from error


def _merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of ``base`` with those of ``changes`` put over them, key by key."""
    merged = dict(base)
    for key, value in changes.items():
        old = merged.get(key)
        merged[key] = _merged(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return merged


def _leaves(value: Any, key: str) -> Iterator[tuple[str, Any]]:
    """Every value that is neither a table nor a list, and where it lies."""
    if isinstance(value, Mapping):
        for name, part in value.items():
            yield from _leaves(part, f"{key}.{name}" if key else name)
    elif isinstance(value, list | tuple):
        for index, part in enumerate(value):
            yield from _leaves(part, f"{key}.{index}")
    else:
        yield key, value
