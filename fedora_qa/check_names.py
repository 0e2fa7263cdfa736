"""The names of checks and subjects, as options, policies and ``explain`` take them."""

from collections.abc import Collection, Iterable

from fedora_qa.checks.explanation import Explanation, published_explanations
from fedora_qa.errors import MisuseError, did_you_mean


def subject_of(name: str) -> str:
    """Return the subject of a check ``<subject>.<property>``; of a subject, itself."""
    return name.split(".", maxsplit=1)[0]


def check_names() -> tuple[str, ...]:
    """Return the subjects, each followed by its checks, in the order in which they run."""
    checks = [explained.check for explained in published_explanations()]
    return tuple(dict.fromkeys(name for check in checks for name in (subject_of(check), check)))


def module_of(check: str) -> str:
    """Return the module of a check, which ``select_checks`` imports."""
    return f"fedora_qa.checks.{check}"


def require_check_names(names: Iterable[str], also: Iterable[str] = ()) -> None:
    """Raise ``MisuseError`` for a name that is no check, no subject and none of ``also``; it proposes the nearest."""
    legal = (*check_names(), *also)
    for name in names:
        if name not in legal:
            raise MisuseError(
                f"Expected a subject or check, got {name!r}; `fedora-qa checks` and `fedora_qa.explain()` list them"
                f"{did_you_mean(name, legal)}"
            )


def is_selected(check: str, select: Collection[str], ignore: Collection[str]) -> bool:
    """Return whether a check is asked for: its name, its subject's or none at all is selected, and neither ignored."""
    names = {check, subject_of(check)}
    return (not select or not names.isdisjoint(select)) and names.isdisjoint(ignore)


def selected_explanations(select: Collection[str], ignore: Collection[str]) -> tuple[Explanation, ...]:
    """Return the explanations of the checks that are asked for, in the order in which they run.

    Raises
    ------
    MisuseError
        A name is that of no subject and no check.
    """
    require_check_names((*select, *ignore))
    return tuple(each for each in published_explanations() if is_selected(each.check, select, ignore))
