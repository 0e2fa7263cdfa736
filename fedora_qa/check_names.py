"""The names of checks and subjects, as options, policies and ``explain`` take them."""

from collections.abc import Iterable

from fedora_qa.checks.explanation import published_explanations
from fedora_qa.errors import MisuseError, did_you_mean


def check_names() -> tuple[str, ...]:
    """Return the subjects, each followed by its checks, in the order in which they run."""
    checks = [explained.check for explained in published_explanations()]
    return tuple(dict.fromkeys(name for check in checks for name in (check.split(".")[0], check)))


def require_check_names(names: Iterable[str], also: Iterable[str] = ()) -> None:
    """Raise ``MisuseError`` for a name that is no check, no subject and none of ``also``; it proposes the nearest."""
    legal = (*check_names(), *also)
    for name in names:
        if name not in legal:
            raise MisuseError(
                f"Expected a subject or check, got {name!r}; `fedora-qa checks` and `fedora_qa.explain()` list them"
                f"{did_you_mean(name, legal)}"
            )
