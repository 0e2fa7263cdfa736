"""Do the declared units agree with the layout?"""

from collections.abc import Iterator
from typing import Final

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.families import over_all_rates
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic, Suspect
from fedora_qa.conventions import FORMAT_NAME
from fedora_qa.layout.binding import Binding
from fedora_qa.layout.canonical import DATASETS, FLOW_STREAMS
from fedora_qa.layout.dialect import NS_PER_TIME_UNIT, SCALES
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts

_SAME_UNIT: Final = {"µs": "us", "μs": "us", "microseconds": "us", "m/s2": "m/s^2", "m/s**2": "m/s^2",
                     "pixel": "px", "pixels": "px", "": "1", "dimensionless": "1", "dn": "DN"}  # fmt: skip
"""Spellings of the units of the layout."""


class MetadataUnits(FactsCheck):
    """Do the labels of units agree with the layout that the values are read in?

    The datasets whose attribute ``units`` names another unit than their values are read in.

    Why it matters
    --------------
    A reader who trusts the label converts, and a reader who trusts the layout does not: one of them is off by a
    thousand.

    How
    ---
    The attribute ``units`` of each dataset is compared with the unit of the layout, or of the dialect where the file
    speaks another; common spellings are taken for the same. A label that contradicts it is broken, a missing one is
    noted. The suspected fault is the one that the label, if it tells the truth, confesses to.

    Noise model
    -----------
    None: a label agrees or not.

    Cannot see
    ----------
    Whether the values are in that unit: ``clocks.unit``, ``depth.scale``, ``flow_photometric`` and the inertial
    checks infer units from the data.

    Sources
    -------
    The canonical layout, version 1.0; for files of other makers the dialect that was recognised.
    """

    name = "metadata.units"

    def not_applicable(self, facts: Facts) -> str:
        """Files of other makers carry no labels."""
        labelled = bool(facts.declared.units) or facts.layout.dialect_name == FORMAT_NAME
        return "" if labelled else f"no dataset of this {facts.layout.dialect_name} file carries a label"

    def examine(self, facts: Facts) -> Observation:
        """Compare each label."""
        bindings, labels = facts.layout.bindings, facts.declared.units
        wrong = [key for key, label in labels.items() if not label_agrees(bindings[key], label)]
        missing = [key for key in bindings if key not in labels]
        measured = over_all_rates((self._measured(key, labels[key]) for key in wrong), set(facts.flow_streams))
        measured = measured or (no_faults("wrong_labels", "labels", self.name),)
        notices: tuple[Notice, ...] = ()
        if missing:
            message = f"{len(missing)} datasets carry no attribute 'units', first {missing[0]}"
            notices = (Notice("metadata.units.missing", message, Where(stream=DATASETS[missing[0]].stream)),)
        return Observation(Coverage(len(bindings) - len(missing), len(bindings), "labels"), measured, notices)

    def _measured(self, key: str, label: str) -> Statistic:
        spec = DATASETS[key]
        return count_of_faults(
            name=f"{key}@units",
            value=1,
            unit="labels",
            statement=f"{key} is labelled {label!r}; the layout has it in {spec.units!r}",
            code="metadata.units.label",
            where=Where(stream=spec.stream),
            suspects=tuple(_suspects_of_label(key, label)),
        )


def label_agrees(binding: Binding, label: str) -> bool:
    """Whether a label names the unit that the values of a dataset are read in."""
    label = _normalised(label)
    if binding.ns_per_unit is not None:
        return NS_PER_TIME_UNIT.get(label) == binding.ns_per_unit
    canonical = DATASETS[binding.key].units
    return SCALES.get((label, canonical), 1.0 if label == canonical else 0.0) == binding.scale


def _suspects_of_label(key: str, label: str) -> Iterator[Suspect]:
    """Name the fault that the label, if it tells the truth, would confess to."""
    spec, label = DATASETS[key], _normalised(label)
    if spec.is_timestamps and label in NS_PER_TIME_UNIT:
        yield Suspect("time_unit", spec.stream, 0.5, NS_PER_TIME_UNIT["us"] / NS_PER_TIME_UNIT[label], "1")
    factor = SCALES.get((label, spec.units))
    cause = {"mm": "unit_mm_m", "m": "unit_mm_m", "rad/s": "unit_deg_rad"}.get(spec.units)
    if factor and cause:
        yield Suspect(cause, spec.stream, 0.5, 1 / factor, "1")
    if spec.stream in FLOW_STREAMS and label == "px/s":
        yield Suspect("flow_unit", spec.stream, 0.5)


def _normalised(label: str) -> str:
    label = label.strip()
    return _SAME_UNIT.get(label.lower(), label)
