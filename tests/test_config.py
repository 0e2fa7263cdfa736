"""The configuration: defaults, what a file may say, and what is refused by name."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.config import CheckConfig, parse_bytes, read_config
from fedora_qa.errors import MisuseError, did_you_mean

FULL = """
effort = "quick"
select = ["clocks", "imu.noise"]
ignore = ["depth"]
dialect = "fedora"
fail_on = "warned"
memory = "512MiB"
false_alarm_rate = 1e-6
[required_coverage]
"event_response.timing" = 1
clocks = 0.5
"""


def written(folder: Path, text: str) -> Path:
    """A configuration file with this text."""
    path = folder / "fedora-qa.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_key(tmp_path: Path) -> None:
    """All keys are read as what they mean."""
    assert read_config(written(tmp_path, FULL)) == CheckConfig(
        effort="quick",
        select=("clocks", "imu.noise"),
        ignore=("depth",),
        dialect="fedora",
        fail_on="warned",
        memory="512MiB",
        false_alarm_rate=1e-6,
        required_coverage={"event_response.timing": 1.0, "clocks": 0.5},
    )


def test_an_empty_file_is_the_default(tmp_path: Path) -> None:
    """A file that says nothing changes nothing."""
    assert read_config(written(tmp_path, "")) == CheckConfig()


def test_a_dialect_lies_beside_the_configuration(tmp_path: Path) -> None:
    """A dialect file is looked for where the configuration is, not where the command runs."""
    assert read_config(written(tmp_path, 'dialect = "mine.toml"')).dialect == str(tmp_path / "mine.toml")


REFUSED = {
    "unknown key": ('efort = "full"', "'efort', which does not exist"),
    "illegal value": ('effort = "heroic"', "'effort'"),
    "wrong type": ("select = 3", "'select'"),
    "rate out of range": ("false_alarm_rate = 1.0", "'false_alarm_rate'"),
    "share out of range": ("[required_coverage]\nclocks = 1.5", "'required_coverage.clocks'"),
    "memory without unit": ('memory = "1000"', "'1000'"),
    "too little memory": ('memory = "1kB"', "at least"),
    "no TOML": ("effort =", "TOML"),
    "no text": ("\udcff", "TOML"),
}


@pytest.mark.parametrize(("text", "named"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_refused(text: str, named: str, tmp_path: Path) -> None:
    """The offending key is named, with what was expected."""
    path = tmp_path / "fedora-qa.toml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(MisuseError, match="Expected") as refused:
        read_config(path)
    assert named in str(refused.value)


MISSPELT = {
    "key": ('efort = "full"', "did you mean 'effort'?"),
    "value": ('effort = "ful"', "did you mean 'full'?"),
}


@pytest.mark.parametrize(("text", "hint"), MISSPELT.values(), ids=MISSPELT.keys())
def test_the_nearest_name_is_proposed(text: str, hint: str, tmp_path: Path) -> None:
    """A key or value that is nearly right is refused with the right one."""
    path = tmp_path / "fedora-qa.toml"
    path.write_text(text)
    with pytest.raises(MisuseError) as refused:
        read_config(path)
    assert str(refused.value).endswith(hint)


def test_nothing_far_is_proposed() -> None:
    """A name that is like none gets no proposal."""
    assert did_you_mean("heroic", ["quick", "standard", "full"]) == ""
    assert did_you_mean("", ["quick"]) == ""


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    """A configuration that is not there is misuse, not the default."""
    with pytest.raises(MisuseError, match="No such file"):
        read_config(tmp_path / "none.toml")


AMOUNTS = {"1GB": 10**9, "512MiB": 2**29, " 1.5 gb ": 15 * 10**8, "70000000B": 7 * 10**7}


@pytest.mark.parametrize(("text", "amount"), AMOUNTS.items())
def test_amounts_of_memory(text: str, amount: int) -> None:
    """Decimal and binary units, in any case."""
    assert parse_bytes(text) == amount


@given(st.text())
def test_no_text_breaks_the_amount(text: str) -> None:
    """Anything that is not an amount is misuse, never another error."""
    try:
        amount = parse_bytes(text)
    except MisuseError:
        return
    assert amount > 0


def test_the_digest_is_of_the_content() -> None:
    """Equal configurations have one digest, different ones have another."""
    one = CheckConfig(select=("clocks",), required_coverage={"a": 0.5, "b": 1.0})
    assert one.digest == replace(one, required_coverage={"b": 1.0, "a": 0.5}).digest
    assert one.digest != replace(one, select=("imu",)).digest
