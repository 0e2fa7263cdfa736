"""The report as one HTML file. ``fedora_reports`` is an optional package, imported only where a report is requested."""

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from fedora_qa.cli.published_studies import fault_price_texts, pass_detection_power
from fedora_qa.comparison.types import Comparison
from fedora_qa.errors import MisuseError
from fedora_qa.record.types import Record
from fedora_qa.scoring.types import Score


def require_renderer() -> None:
    """Raise ``MisuseError`` where ``fedora_reports`` is not installed."""
    try:
        from fedora_reports import html  # noqa: F401, PLC0415 - an extra
    except ImportError as missing:
        raise MisuseError(
            f"Expected what draws reports, got: {missing}; install it with pip install 'fedora-qa[reports]'"
        ) from None


def render_html_or_none(record: Record, arrays: Mapping[str, NDArray[Any]]) -> str | None:
    """Draw the report from a record and its arrays; None where ``fedora_reports`` is not installed."""
    try:
        from fedora_reports.html import render_html  # noqa: PLC0415 - an extra
    except ImportError:
        return None
    return render_html(record, arrays)


def render_comparison_or_none(comparison: Comparison) -> str | None:
    """Draw the report of a comparison; None where ``fedora_reports`` is not installed."""
    try:
        from fedora_reports.comparison import render_comparison  # noqa: PLC0415 - an extra
    except ImportError:
        return None
    return render_comparison(comparison)


def render_score_or_none(score: Score) -> str | None:
    """Draw the page of a score; None where ``fedora_reports`` is not installed."""
    try:
        from fedora_reports.score import render_score  # noqa: PLC0415 - an extra
    except ImportError:
        return None
    return render_score(score)


def render_record(record: Record, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Draw the report from a record and its arrays, with the detection power that was measured."""
    from fedora_reports.html import render_html  # noqa: PLC0415 - an extra

    return render_html(record, arrays, pass_detection_power(), fault_price_texts())
