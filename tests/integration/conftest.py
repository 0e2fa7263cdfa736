"""What holds of every file that is checked here."""

import pytest

from fedora_qa.judgement.materiality import Materiality, Profile, materiality_row
from fedora_qa.sequence.facts import Facts


class Complete(Materiality):
    """Material sizes that accept no statistic without a row, under any profile."""

    def size(self, code: str, unit: str, expected: float, effect_px: float | None = None) -> float:
        assert materiality_row(code, unit) is not None, (code, unit)
        return super().size(code, unit, expected, effect_px)


@pytest.fixture(autouse=True)
def _every_measurement_has_a_material_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the checks measure on clean and on faulty files has a row in the table of material sizes."""

    def complete(profile: Profile, facts: Facts) -> Materiality:
        return Complete(profile)

    monkeypatch.setattr("fedora_qa.engine.assemble.materiality_of", complete)
