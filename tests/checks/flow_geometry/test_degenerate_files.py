"""Whatever a file holds, the checks of flow give an answer and never an exception."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from fedora_qa.checks.flow_geometry.endpoint import FlowGeometryEndpoint
from fedora_qa.checks.flow_geometry.validity import FlowGeometryValidity
from fedora_qa.checks.flow_photometric.residual import FlowPhotometricResidual
from fedora_qa.checks.protocol import Check
from fedora_qa.sequence.facts import Clock
from tests.support.flow_world import FlowWorld, judged, make_world


@cache
def clean() -> FlowWorld:
    return make_world((25,))


def cut(stream: str, count: int) -> FlowWorld:
    """The clean file with only the first items of a stream."""
    world = clean()
    whole = world.facts.clocks[stream]
    ends_ns = None if whole.ends_ns is None else whole.ends_ns[:count]
    kept = Clock(whole.times_ns[:count], ends_ns, whole.advancing[:count])
    rows = {key: v[:count] if key.startswith(f"path/{stream}") else v for key, v in world.rows_by_key.items()}
    facts = replace(
        world.facts,
        clocks={**world.facts.clocks, stream: kept},
        sizes={key: len(values) for key, values in rows.items()},
    )
    return replace(world, facts=facts, rows_by_key=rows)


def filled(key: str, value: float) -> FlowWorld:
    rows = clean().rows_by_key
    return replace(clean(), rows_by_key={**rows, key: np.full_like(rows[key], value)})


STRANGE = {
    "no poses": lambda: cut("pose", 0),
    "two poses": lambda: cut("pose", 2),
    "poses end early": lambda: cut("pose", 40),
    "one depth frame": lambda: cut("depth", 1),
    "one colour frame": lambda: cut("rgb", 1),
    "one field": lambda: cut("flow/25hz", 1),
    "NaN poses": lambda: filled("path/pose/position", np.nan),
    "zero quaternions": lambda: filled("path/pose/orientation", 0.0),
    "NaN depth": lambda: filled("path/depth", np.nan),
    "zero depth": lambda: filled("path/depth", 0.0),
    "infinite depth": lambda: filled("path/depth", np.inf),
    "NaN flow": lambda: filled("path/flow/25hz", np.nan),
    "infinite flow": lambda: filled("path/flow/25hz", np.inf),
    "zero flow": lambda: filled("path/flow/25hz", 0.0),
    "enormous flow": lambda: filled("path/flow/25hz", 1e30),
    "black frames": lambda: filled("path/rgb", 0),
    "singular intrinsics": lambda: clean().declaring(
        cameras={name: replace(c, K=np.eye(3)) for name, c in clean().facts.declared.cameras.items()}
    ),
    "fields of another size": lambda: clean().with_flow(lambda _, flow: flow[:, ::3, ::3]),
    "tiny images": lambda: clean().with_rows(
        path_depth=clean().rows_by_key["path/depth"][:, :30, :30],
        path_rgb=clean().rows_by_key["path/rgb"][:, :30, :30],
    ).with_flow(lambda _, flow: flow[:, :30, :30]),
}  # fmt: skip


@pytest.mark.parametrize(
    "check", [FlowGeometryEndpoint(), FlowGeometryValidity(), FlowPhotometricResidual()], ids=lambda check: check.name
)
@pytest.mark.parametrize("world", STRANGE.values(), ids=STRANGE)
def test_strange_file_is_answered(check: Check[Any], world: Any) -> None:
    """An outcome, and a reason where nothing could be seen."""
    result = judged(check, world()).result
    assert result.outcome in {"passed", "failed", "warned", "not_observable"}
    assert result.reason or result.outcome in {"passed", "failed"}
