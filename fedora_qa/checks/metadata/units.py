"""Do the declared units agree with the layout?"""

from dataclasses import dataclass
from typing import Final

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.flow_rate_deviations import with_flow_rate_deviations
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic
from fedora_qa.conventions import FORMAT_NAME
from fedora_qa.features import Feature
from fedora_qa.layout.binding import Binding
from fedora_qa.layout.canonical import DATASETS, spec_of
from fedora_qa.layout.dialect import NS_PER_TIME_UNIT, SCALES
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts

# The micro sign (U+00B5) and the Greek mu (U+03BC) are different characters, both in use.
_SAME_UNIT: Final = {"µs": "us", "μs": "us", "microseconds": "us", "m/s2": "m/s^2", "m/s**2": "m/s^2",
                     "pixel": "px", "pixels": "px", "": "1", "dimensionless": "1", "dn": "DN"}  # fmt: skip
"""Spellings of the units of the layout."""

_UNITS: Final = {
    unit.lower(): unit
    for unit in (*NS_PER_TIME_UNIT, *(unit for pair in SCALES for unit in pair), *(s.units for s in DATASETS.values()))
}
"""Units of the layout, and those that are converted to them, by their lower case."""


@dataclass(frozen=True, slots=True)
class UnitLabel(Feature):
    """The unit in the label of a dataset, with that of the layout.

    Attributes
    ----------
    label, expected
        The label in the spelling of the layout, and the unit of the layout.
    time_factor
        Factor by which timestamps in the labelled unit are too large; None for other values than timestamps.
    scale
        Factor from the labelled to the expected unit, None where there is none.
    """

    label: str
    expected: str
    time_factor: float | None
    scale: float | None


class MetadataUnits(FactsCheck):
    """Do the labels of units agree with the units in which the values are read?

    The datasets whose attribute ``units`` names another unit than that in which their values are read.

    Why it matters
    --------------
    A reader that follows the label converts the values, and a reader that follows the layout does not. Their results
    differ by the factor of the units, often 1000.

    How
    ---
    The attribute ``units`` of each dataset is compared with the unit of the layout, or of the file's dialect. Common
    spellings of a unit count as equal. A label that names another unit is a finding. A missing label is noted, and so
    is one in another case. The suspected cause is the one that applies if the label is true.

    Noise model
    -----------
    None: a label agrees or does not.

    Cannot detect
    -------------
    Whether the values are in that unit: ``clocks.unit``, ``depth.scale``, ``flow_photometric`` and the checks of the
    IMU infer units from the data.

    Sources
    -------
    The canonical layout, version 1.0; for files of other makers the dialect that was recognised.
    """

    name = "metadata.units"

    def not_applicable(self, facts: Facts) -> str:
        """Require labels: files of other makers may carry none."""
        labelled = bool(facts.declared.units) or facts.layout.dialect_name == FORMAT_NAME
        return "" if labelled else f"no dataset of this {facts.layout.dialect_name} file carries a label"

    def examine(self, facts: Facts) -> Observation:
        """Compare each label with the unit of the layout."""
        bindings, labels = facts.layout.bindings, facts.declared.units
        wrong: list[Statistic] = []
        for key, label in labels.items():
            if label_agrees(bindings[key], label):
                continue
            spec, unit = spec_of(key), _normalised(label)
            time_factor = None
            if spec.is_timestamps and unit in NS_PER_TIME_UNIT:
                time_factor = NS_PER_TIME_UNIT["us"] / NS_PER_TIME_UNIT[unit]
            wrong.append(
                count_of_faults(
                    name=f"{key}@units",
                    value=1,
                    unit="labels",
                    statement=f"{key} is labelled {label!r}; the unit of the layout is {spec.units!r}",
                    code="metadata.units.label",
                    where=Where(stream=spec.stream),
                    features=(UnitLabel(unit, spec.units, time_factor, SCALES.get((unit, spec.units))),),
                )
            )
        statistics = with_flow_rate_deviations(wrong, set(facts.flow_streams))
        statistics = statistics or (no_faults("wrong_labels", "labels", self.name),)
        missing = [key for key in bindings if key not in labels]
        notices: list[Notice] = []
        if missing:
            message = f"{len(missing)} datasets carry no attribute 'units', first {missing[0]}"
            notices.append(Notice("metadata.units.missing", message, Where(stream=spec_of(missing[0]).stream)))
        in_other_case = [key for key, label in labels.items() if _is_in_other_case(label.strip())]
        if in_other_case:
            key = in_other_case[0]
            message = (
                f"{len(in_other_case)} labels are in another case, first {labels[key]!r} of {key}; use the "
                "spelling of the layout"
            )
            notices.append(Notice("metadata.units.case", message, Where(stream=spec_of(key).stream)))
        return Observation(Coverage(len(bindings) - len(missing), len(bindings), "labels"), statistics, tuple(notices))


def label_agrees(binding: Binding, label: str) -> bool:
    """Whether a label names the unit in which the values of a dataset are read.

    Parameters
    ----------
    binding
        Of the dataset, with its unit.
    label
        As stored.
    """
    label = _normalised(label)
    # The layout states the unit of timestamps in ns a unit, that of other values as a scale.
    if binding.ns_per_unit is not None:
        return NS_PER_TIME_UNIT.get(label) == binding.ns_per_unit
    canonical = spec_of(binding.key).units
    return SCALES.get((label, canonical), 1.0 if label == canonical else 0.0) == binding.scale


def _normalised(label: str) -> str:
    label = label.strip()
    # No two units of the layout and its conversions differ in case alone.
    return _SAME_UNIT.get(label.lower(), _UNITS.get(label.lower(), label))


def _is_in_other_case(label: str) -> bool:
    unit = _normalised(label)
    return label not in {unit, *_SAME_UNIT} and label.lower() == unit.lower()
