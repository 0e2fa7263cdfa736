"""The table of costs compares what it says it does, and its picture shows the numbers."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

from fedora_generator.choices import STREAMS
from fedora_generator.scene import load_scene
from tests.benchmarks.bar_chart import Bars, bar_chart
from tests.benchmarks.generation_costs import EVENTS, Case, Cost, Group, by_effect, groups, measure, page, picture

SVG = "{http://www.w3.org/2000/svg}"

ABOUT = Group("About `x`", "why", (Case("base", load_scene("hover").with_size(36, 27), frozenset({"imu"})),) * 2)
COSTS = (Cost(start_s=0.5, second_s=2.0, ratio=1.0), Cost(start_s=0.5, second_s=3.0, ratio=1.5))


def test_every_stream_is_measured_alone() -> None:
    """And all of them together."""
    streams = [case.streams for case in groups()[0].cases]
    assert {frozenset({name}) for name in STREAMS} < set(streams)
    assert frozenset(STREAMS) in streams


def test_an_effect_is_the_only_difference() -> None:
    """Each case changes its own options of the noisy scene; together they are all that it has."""
    base, again, *others, everything = by_effect().cases
    assert base.scene == again.scene
    noisy = load_scene("park-noisy").events
    added = base.scene.events
    for case in others:
        assert replace(case.scene, events=base.scene.events) == base.scene
        assert case.scene.events != base.scene.events
        assert case.streams == EVENTS
        changed = {name: getattr(case.scene.events, name) for name in case.scene.events.__slots__}
        added = replace(
            added, **{name: value for name, value in changed.items() if value != getattr(base.scene.events, name)}
        )
    assert replace(added, packet_interval_us=0) == noisy == everything.scene.events


def test_a_round_measures_both_parts(tmp_path: Path) -> None:
    """The base is 1 times itself, and nothing is free."""
    base, again = measure(ABOUT, tmp_path, rounds=1)
    assert base.ratio == 1.0
    assert base.start_s > 0
    assert base.second_s > 0
    assert again.ratio > 0


def test_the_page_has_a_row_for_each_case() -> None:
    """With the seconds and the ratio."""
    text = "".join(page([(ABOUT, COSTS)]))
    assert "## About `x`" in text
    assert "| base | 0.50 | 3 | 1.50 |" in text
    assert max(map(len, text.splitlines())) <= 120


def test_bars_are_as_long_as_their_values() -> None:
    """Of the longest, in a picture that any parser reads; labels are escaped."""
    chart = bar_chart([Bars(title="a < b", names=["x & y", "z"], values=[2.0, 0.5], labels=["2 s", "0.5 s"])], alt="A")
    root = ET.fromstring(chart)
    long, short = (float(bar.attrib["width"]) for bar in root.iter(f"{SVG}rect"))
    assert abs(short / long - 0.25) < 1e-3
    assert {"a < b", "x & y", "z", "2 s"} <= {text.text for text in root.iter(f"{SVG}text")}
    assert len(list(ET.fromstring(picture([(ABOUT, COSTS)])).iter(f"{SVG}rect"))) == 2
