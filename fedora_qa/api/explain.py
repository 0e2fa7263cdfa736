"""Explain checks from Python."""

from collections.abc import Iterator
from dataclasses import dataclass

from fedora_qa.checks.explanation import Explanation, published_explanations
from fedora_qa.cli.explain import explanations_of, needs_words
from fedora_qa.record.notebook import html_lines, html_table, html_text


@dataclass(frozen=True, slots=True, repr=False)
class ExplainedChecks:
    """What checks ask and how they answer it; it iterates over them.

    Attributes
    ----------
    explanations
        One for each check, in the order in which they run.
    """

    explanations: tuple[Explanation, ...]

    def __iter__(self) -> Iterator[Explanation]:
        return iter(self.explanations)

    def __len__(self) -> int:
        return len(self.explanations)

    def __repr__(self) -> str:
        if len(self) > 1:
            return "\n".join(f"{each.check}: {each.question}" for each in self)
        return "\n".join(line for each in self for line in _lines(each))

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook: of several checks their questions, of one all that is known."""
        if len(self) > 1:
            return html_table(("check", "question"), [(each.check, each.question) for each in self])
        return "".join(f"<h4>{html_text(each.check)}</h4>{html_lines(_lines(each)[1:])}" for each in self)


def explain(name: str | None = None) -> ExplainedChecks:
    """Return what a check measures, how, and what it cannot detect; as ``fedora-qa explain`` prints it.

    Parameters
    ----------
    name
        A check, such as ``"clocks.order"``, or the code of a finding, for its check; or a subject, for each of its
        checks; None: every check.

    Raises
    ------
    MisuseError
        There is no such check or subject.
    """
    return ExplainedChecks(published_explanations() if name is None else explanations_of(name))


def _lines(explained: Explanation) -> list[str]:
    text = f"{explained.check}\n{needs_words(explained)}\n\n{explained.question}\n\n{explained.measured}"
    sections = "".join(f"\n\n{title}\n\n{section}" for title, section in explained.sections.items())
    return (text + sections).splitlines()
