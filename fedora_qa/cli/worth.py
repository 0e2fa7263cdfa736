"""What a passed check is worth, in words: shown by ``fedora-qa explain`` where a table has been published."""

from fedora_qa.power.worth import Found, Worth, read_worth
from fedora_qa.record.power_tables import estimate_words, share_words

TITLE = "Measured power"


def worth_words(check: str) -> str:
    """Return what the check was measured to find, a cause a line; empty where nothing has been published."""
    worth = read_worth()
    if worth is None:
        return ""
    lines = [_line(one) for one in worth.of(check)] or ["No cause that was planted is surely found by it."]
    return "\n".join([*lines, "", _whence(worth)])


def _line(one: Found) -> str:
    if one.at_95.value is None:
        return f"{one.cause}: found {share_words(one.found)}"
    return f"{one.cause}: 95% at {estimate_words(one.at_95, one.unit)}"


def _whence(worth: Worth) -> str:
    stale = " The code has changed since: run `make power` for numbers of this one." if worth.is_stale() else ""
    return f"Over {worth.files} short and small files, {worth.clean} of them clean (`fedora-qa power`).{stale}"
