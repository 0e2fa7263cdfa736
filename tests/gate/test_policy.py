"""The policy: the documented example, what is refused by name, and its digest."""

import re
import tomllib
from dataclasses import fields, replace
from datetime import date
from pathlib import Path

import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.gating.policy import Bounds, Documents, Policy, each_stream, read_policy

DOCS = Path(__file__).parents[2] / "docs" / "gate.md"
EXAMPLE = re.findall(r"```toml\n(.*?)```", DOCS.read_text(encoding="utf-8"), flags=re.DOTALL)[0]


def written(folder: Path, text: str) -> Path:
    """A policy with this text."""
    path = folder / "policy.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_documented_example_is_read(tmp_path: Path) -> None:
    """Every key of the documented policy means what it says, and the example shows every key."""
    policy = read_policy(written(tmp_path, EXAMPLE))
    assert policy.check.ignore == ("imu.noise",)
    assert policy.check.required_coverage == {"integrity": 1.0}
    assert policy.severity == {"images": "warning", "metadata.complete": "error"}
    assert policy.totals == {"sequences": Bounds(2, 40), "duration_s": Bounds(least=0.1)}
    assert policy.documents == Documents("DATASHEET.md", "LICENSE", "SHA256SUMS")
    assert policy.splits == {"train": ("train/*",), "test": ("test/*",)}
    assert policy.waivers[0].expires == date(2099, 12, 31)
    assert set(tomllib.loads(EXAMPLE)) == {field.name for field in fields(Policy)}


def test_only_the_ruleset_must_be_there(tmp_path: Path) -> None:
    """A policy that only pins the ruleset is one of defaults."""
    assert read_policy(written(tmp_path, 'ruleset_version = "2"')) == Policy("2")


WAIVER = '[[waivers]]\nfile = "a.h5"\ncheck = "imu.noise"\nreason = "r"\nowner = "o"\nexpires = 2099-01-01\n'
REFUSED = {
    "unknown key": ("requird = 1", "'requird', which does not exist"),
    "unknown key of check": ("[check]\nefort = 1", "'check.efort', which does not exist; did you mean 'effort'?"),
    "unknown key of a waiver": (f'{WAIVER}code = "x"\nuntil = 1', "'waivers.0.until', which does not exist"),
    "unknown total": ("[totals.frames]\nleast = 1", "'totals.frames"),
    "unknown severity": ('[severity]\nimu = "grave"', "'severity.imu'"),
    "unknown check": ('[severity]\nimo = "error"', "did you mean 'imu'?"),
    "unknown rule": ('[severity]\n"release.split" = "error"', "did you mean 'release.splits'?"),
    "unknown stream": ('required_streams = ["rbg"]', "did you mean 'rgb'?"),
    "unknown camera": ('same_intrinsics = ["left"]', "'same_intrinsics.0'"),
    "required and left out": ('required_checks = ["imu.noise"]\n[check]\nignore = ["imu"]', "imu.noise, left out"),
    "no expression": ('naming = "("', "'naming'"),
    "pattern out of the folder": ('files = ["../*.h5"]', "'../*.h5'"),
    "pattern with a backslash": ("files = ['a\\*.h5']", r"'a\\*.h5'"),
    "document out of the folder": ('[documents]\nlicence = "../LICENSE"', "'../LICENSE'"),
    "no amount": ('[check]\nmemory = "1000"', "'1000'"),
    "waiver without a target": (WAIVER, "either a code or a cause"),
    "waiver with two targets": (f'{WAIVER}code = "x"\ncause = "imu:y"', "either a code or a cause"),
    "waiver of no check": (
        f'{WAIVER}code = "imu.nois.x"'.replace('"imu.noise"', '"imu.nois"'),
        "a.h5, got 'imu.nois'; did you mean 'imu.noise'?",
    ),
    "waiver of another check's rule": (f'{WAIVER}code = "imu.rate.gyro"', "begins with imu.noise. in the waiver of o"),
    "waiver of no cause": (f'{WAIVER}cause = "imu:gyro_bia"', "did you mean 'imu:gyro_bias'?"),
    "waiver of no stream": (f'{WAIVER}cause = "imo:gyro_bias"', "did you mean 'imu:gyro_bias'?"),
    "waiver without a reason": (f'{WAIVER}code = "x"'.replace('"r"', '""'), "'waivers.0.reason'"),
    "waiver without a day": (f'{WAIVER}code = "x"'.replace("2099-01-01", '"soon"'), "'waivers.0.expires'"),
}


@pytest.mark.parametrize(("text", "named"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_refused(text: str, named: str, tmp_path: Path) -> None:
    """The offending key or value is named, with what was expected."""
    with pytest.raises(MisuseError, match="Expected") as refused:
        read_policy(written(tmp_path, f'ruleset_version = "2"\n{text}'))
    assert named in str(refused.value)


def test_another_ruleset_is_refused(tmp_path: Path) -> None:
    """A policy for another ruleset says which it pins and which this is."""
    with pytest.raises(MisuseError, match=r"ruleset '99'.*got '2'"):
        read_policy(written(tmp_path, 'ruleset_version = "99"'))


def test_a_dialect_lies_beside_the_policy(tmp_path: Path) -> None:
    """A dialect's file is looked for where the policy is."""
    text = 'ruleset_version = "2"\n[check]\ndialect = "mine.toml"'
    assert read_policy(written(tmp_path, text)).check.dialect == str(tmp_path / "mine.toml")


def test_the_digest_is_of_what_the_policy_says(tmp_path: Path) -> None:
    """Comments and order change nothing; any value does."""
    policy = read_policy(written(tmp_path, EXAMPLE))
    assert policy.digest == read_policy(written(tmp_path, EXAMPLE + "# a remark\n")).digest
    assert policy.digest == replace(policy, check=replace(policy.check, jobs=7)).digest
    assert policy.digest != replace(policy, naming=None).digest
    assert policy.digest != replace(policy, check=replace(policy.check, effort="quick")).digest


def test_flow_is_every_rate() -> None:
    """``flow`` stands for its rates, every other stream for itself."""
    assert each_stream(("rgb", "flow"), ()) == ("rgb", "flow/10hz", "flow/25hz", "flow/50hz")
    assert each_stream(("rgb", "flow"), {"rgb", "flow/20hz", "flow/12.5hz"}) == ("rgb", "flow/12.5hz", "flow/20hz")
