"""The help of the rules of each check, as code scanning shows it beside an alert."""

from collections.abc import Mapping

from fedora_qa.causes import CAUSES
from fedora_qa.checks.explanation import Explanation, published_explanations
from fedora_qa.cli.markdown import markdown_of
from fedora_qa.cli.published_studies import fault_price_text
from fedora_qa.diagnosis.direct import is_direct
from fedora_qa.record.sarif import RuleHelp

_NAMED_IN_RESULTS = "The message of a result names the probable cause and its remedy, where there is one."


def rule_helps() -> Mapping[str, RuleHelp]:
    """Return the help of the rules of every check, by the name of the check."""
    return {explained.check: _help_of(explained) for explained in published_explanations()}


def _help_of(explained: Explanation) -> RuleHelp:
    """Return what a check measures, why it matters, what it cannot detect, and what to do."""
    price = "\n".join(f"- {line}" if line else "" for line in fault_price_text(explained.check).splitlines()[:-1])
    sections = {
        "What is checked": explained.measured,
        "Why it matters": "\n\n".join(filter(None, (explained.sections["Why it matters"], price))),
        "What it cannot detect": explained.sections["Cannot detect"],
        "What to do": "\n".join([*_remedies(explained.check), _NAMED_IN_RESULTS]),
    }
    text = "\n\n".join(f"{title}\n{section}" for title, section in sections.items()).replace("``", "")
    markdown = "\n\n".join(f"## {title}\n\n{markdown_of(section)}" for title, section in sections.items())
    return RuleHelp(
        description=explained.measured.replace("``", ""),
        text=f"{explained.question}\n\n{text}",
        markdown=f"**{markdown_of(explained.question)}**\n\n{markdown}",
    )


def _remedies(check: str) -> list[str]:
    """Return the remedies of the causes that a check measures directly, as a list of Markdown and a blank line."""
    causes = [cause for cause in CAUSES.values() if is_direct(cause.identifier, f"{check}.rule")]
    items = [f"- {cause.meaning[0].upper()}{cause.meaning[1:]}: {cause.remedy}" for cause in causes]
    return [*items, ""] if items else []
