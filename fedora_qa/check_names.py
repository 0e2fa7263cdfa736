"""The names of checks and subjects, as options, policies and ``explain`` take them."""

from collections.abc import Collection, Iterable, Sequence
from difflib import get_close_matches

from fedora_qa.checks.explanation import Explanation, published_explanations
from fedora_qa.errors import MisuseError, did_you_mean


def subject_of(name: str) -> str:
    """Return the subject of a check ``<subject>.<property>``; of a subject, itself."""
    return name.split(".", maxsplit=1)[0]


def check_names() -> tuple[str, ...]:
    """Return the subjects, each followed by its checks, in the order in which they run."""
    checks = [explained.check for explained in published_explanations()]
    return tuple(dict.fromkeys(name for check in checks for name in (subject_of(check), check)))


def check_of_rule(name: str) -> str:
    """Return the check whose rule or measurement a name is, ``<check>.<rule>``; empty where it begins with no check."""
    return next((each.check for each in published_explanations() if name.startswith(f"{each.check}.")), "")


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
                f"{_near_names(name, legal)}"
            )


def _near_names(name: str, legal: Sequence[str]) -> str:
    """Return a clause that proposes the checks of a property, else the nearest name; empty where none is near."""
    if "." not in name:
        properties = {each.rpartition(".")[2] for each in legal if "." in each}
        nearest = [name] if name in properties else get_close_matches(name, {*properties, *legal}, n=1)
        of_property = [each for each in legal if "." in each and each.rpartition(".")[2] in nearest]
        if of_property and nearest[0] not in legal:
            return f"; did you mean {' or '.join(map(repr, of_property))}?"
    return did_you_mean(name, legal)


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
