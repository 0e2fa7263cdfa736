"""A certificate of an imaginary release."""

from dataclasses import replace
from datetime import date
from typing import Final

from fedora_qa.gating.acceptance import Waiver
from fedora_qa.gating.certificate import Certificate, CertifiedCheck, CertifiedFile, Sight
from fedora_qa.record.types import Coverage, Tool

_UNSIGNED: Final = Certificate(
    certificate_version="1.0",
    issued="2026-06-01T12:00:00+00:00",
    tool=Tool("fedora-qa", "0.1.0"),
    ruleset_version="1",
    effort="full",
    policy_sha256="0" * 64,
    policy_digest="1" * 64,
    files=(
        CertifiedFile(
            name="train/a.h5",
            size=51_300_000,
            sha256="2" * 64,
            checks=(
                CertifiedCheck(
                    "clocks.order", "passed", Coverage(101, 101, "frames"), (Sight("steps", 1.0, "samples"),)
                ),
                CertifiedCheck("imu.timing", "not_observable", None, ()),
            ),
        ),
    ),
    documents={"LICENSE": "3" * 64},
    patterns=("**/*.h5",),
    waivers=(Waiver("train/a.h5", "imu.noise", "known", "anna", date(2026, 6, 30), code="imu.noise.gyro"),),
    noted=("train/a.h5: imu.noise.gyro: The gyro is noisier than declared.",),
)

CERTIFIED: Final = replace(_UNSIGNED, digest=_UNSIGNED.own_digest)
