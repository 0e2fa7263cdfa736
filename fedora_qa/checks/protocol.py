"""The interface of checks, and the results that they return to judgement.

A check measures; it gives no verdict. It accumulates over windows in a state that can be merged, so a file can be
divided in time among workers, and the outcome does not depend on the division.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Literal, TypeVar

from numpy.typing import NDArray

from fedora_qa.estimators.fitting.robust import SensitivityRange
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Severity, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

State = TypeVar("State")
Summary = TypeVar("Summary")


@dataclass(frozen=True, slots=True)
class Statistic:
    """A value with its error under the noise model, and the rule by which it is judged.

    A value exceeds its limit when it differs from ``expected`` by more than ``model_error_bound + z * standard_error``,
    with z from the false-alarm rate of the whole file. A count that must be zero has no error and no bound.

    Attributes
    ----------
    name, value, unit
        The measured quantity.
    standard_error
        Of the value, under the noise model of a correct file, in ``unit``.
    statement
        A sentence that states the deviation in the user's units, for a value that exceeds its limit.
    code
        The rule that is then violated: ``<subject>.<property>.<rule>``.
    where
        Location of the deviation.
    expected
        The value that a correct file gives.
    model_error_bound
        Bound on the systematic error of the method that the standard error does not cover, in ``unit``, with its
        derivation in the check.
    side
        ``upper``: only values above ``expected`` count, ``lower``: only below, ``both``: either.
    resolution
        Least step by which the value can change (1 for a count).
    blind_from
        Detection limit above which the measurement is of no use, where it follows from the file; None: as in the table
        of material sizes (``fedora_qa/judgement/materiality.toml``).
    effect_px
        Root mean square change of the flow of the file by one unit of the value, px, from which its material size
        follows; None where the value is no parameter of the flow.
    tests
        Number of independent comparisons of which the value is the worst.
    sensitivity
        Standard error and model error bound where and when the detection limit is lowest, and where it is highest;
        None where every place and time has the stated ones.
    severity
        Of the finding.
    features
        Typed values that describe the deviation, for diagnosis.
    """

    name: str
    value: float
    unit: str
    standard_error: float
    statement: str
    code: str
    where: Where = field(default_factory=Where)
    expected: float = 0.0
    model_error_bound: float = 0.0
    side: Literal["both", "upper", "lower"] = "both"
    resolution: float = 0.0
    blind_from: float | None = None
    effect_px: float | None = None
    tests: int = 1
    sensitivity: SensitivityRange | None = None
    severity: Severity = "error"
    features: tuple[Feature, ...] = ()


@dataclass(frozen=True, slots=True)
class Notice:
    """Something legal but unusual, or a missing declaration that weakens the check: the outcome becomes ``warned``.

    Attributes
    ----------
    code
        ``<subject>.<property>.<rule>``.
    message
        A sentence for the reader of the report.
    where
        Its location.
    """

    code: str
    message: str
    where: Where = field(default_factory=Where)


@dataclass(frozen=True, slots=True)
class Observation:
    """All results of a check.

    Attributes
    ----------
    coverage
        The share of the stream that was read.
    measurements
        Statistics, for judgement.
    notices
        Without effect on limits.
    unobservable
        Why the quantity cannot be measured in this sequence (hovering, no texture); empty where it can.
    evidence, titles
        Small arrays for a reader of the report, and their titles, by name.
    inferred
        Facts that were inferred and not declared (as the unit of the flow), for the record.
    """

    coverage: Coverage
    measurements: tuple[Statistic, ...] = ()
    notices: tuple[Notice, ...] = ()
    unobservable: str = ""
    evidence: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    titles: Mapping[str, str] = field(default_factory=dict)
    inferred: Mapping[str, str | float] = field(default_factory=dict)


class Check(ABC, Generic[State]):
    """One question about one subject.

    Subclasses set the class attributes; their docstring's first line is the question, the rest states what is
    measured, how, its noise model, what it cannot detect, and its sources (`fedora-qa explain`).
    """

    name: str
    """``<subject>.<property>``."""
    needs: tuple[str, ...] = ()
    """Streams without which the question cannot be answered. ``flow`` stands for at least one rate."""
    looks_at: tuple[str, ...] = ()
    """Further streams whose stored steps it uses, where the file has them."""

    @property
    def question(self) -> str:
        """The question that the check answers."""
        return (self.__doc__ or "").strip().splitlines()[0]

    def not_applicable(self, facts: Facts) -> str:
        """Return why the check does not apply to this file, beyond missing streams; empty where it applies."""
        return ""

    @abstractmethod
    def start(self, facts: Facts) -> State:
        """Return the state of no windows."""

    @abstractmethod
    def update(self, state: State, window: Window) -> None:
        """Add a window to the state. Windows come in the order of time.

        Parameters
        ----------
        state
            Changed in place.
        """

    @abstractmethod
    def merge(self, state: State, later: State) -> State:
        """Return the state of the windows of both; exact, without rounding.

        Parameters
        ----------
        state
            Of earlier windows.
        later
            Of later windows.
        """

    def follow_up_windows(self, state: State, facts: Facts) -> tuple[int, ...]:
        """Return the numbers of the windows that the follow-up measures again; none for most checks."""
        return ()

    def follow_up(self, state: State, window: Window) -> None:
        """Add the measurements of the follow-up in a window.

        Parameters
        ----------
        state
            Of all decoded windows; changed in place.
        window
            One of ``follow_up_windows``.
        """

    @abstractmethod
    def conclude(self, state: State, facts: Facts) -> Observation:
        """Return the results of the check."""


class WindowCheck(Check[list[Summary]], Generic[Summary]):
    """A check whose state is one small summary a window, kept in order.

    Merging is then concatenation, exact by construction; every sum is taken once, at the end, in the order of time.
    """

    def start(self, facts: Facts) -> list[Summary]:
        """Return no summaries."""
        return []

    def update(self, state: list[Summary], window: Window) -> None:
        """Append the window's summary, if it has one."""
        summary = window.derived(self.measure)
        if summary is not None:
            state.append(summary)

    def merge(self, state: list[Summary], later: list[Summary]) -> list[Summary]:
        """Concatenate."""
        return state + later

    @abstractmethod
    def measure(self, window: Window) -> Summary | None:
        """Summarise one window; None where nothing in it can be measured."""

    @abstractmethod
    def conclude(self, state: Sequence[Summary], facts: Facts) -> Observation:
        """Return the results of the check from the summaries of all windows.

        Parameters
        ----------
        state
            Summaries, in the order of time.
        """


class FactsCheck(Check[None]):
    """A check that needs no window: the scan of timestamps and declarations suffices."""

    def start(self, facts: Facts) -> None:
        """Keep nothing."""

    def update(self, state: None, window: Window) -> None:
        """Measure nothing: the facts suffice."""

    def merge(self, state: None, later: None) -> None:
        """Keep nothing."""

    @abstractmethod
    def examine(self, facts: Facts) -> Observation:
        """Return the results of the check from the facts."""

    def conclude(self, state: None, facts: Facts) -> Observation:
        """Return the results of the check from the facts.

        Parameters
        ----------
        state
            None.
        """
        return self.examine(facts)
