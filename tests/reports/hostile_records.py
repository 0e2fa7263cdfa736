"""Strategies for records as a hostile or broken file could make them."""

from hypothesis import strategies as st

from fedora_qa.causes import CAUSES
from fedora_qa.record.types import (
    Coverage,
    Diagnosis,
    FileRecord,
    Finding,
    Measurement,
    Result,
    Where,
)

MARKUP = (
    "<script>alert(1)</script>",
    "</style><img src=http://x>",
    "\"'><b>",
    "{{ 7 * 7 }}",
    "{% raw %}",
    "&lt;",
    "\x00",
)

texts = st.one_of(st.sampled_from(MARKUP), st.text(max_size=12))
words = st.one_of(st.sampled_from(["F1", "a.b", "events", "imu.noise"]), texts)
numbers = st.none() | st.floats() | st.sampled_from([0.0, 1.0, -1e308, 1e308, 5e-324])
counts = st.integers(0, 2**40)
scalars = st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats() | texts

wheres = st.builds(
    Where,
    stream=st.none() | words,
    start_us=st.none() | st.floats(),
    stop_us=st.none() | st.floats(),
    index_start=st.none() | counts,
    index_stop=st.none() | counts,
    frame=st.none() | counts,
    pixel=st.none() | st.tuples(counts, counts),
    tile=st.none() | st.tuples(counts, counts, counts, counts),
)
measurements = st.builds(
    Measurement,
    name=texts,
    value=numbers,
    unit=texts,
    standard_error=st.none() | st.floats(0.0),
    expected=numbers,
    limit=st.none() | st.floats(0.0),
    least_detectable=numbers,
    side=st.sampled_from(["both", "upper", "lower"]),
)
findings = st.builds(
    Finding,
    id=words,
    code=texts,
    severity=st.sampled_from(["critical", "error", "warning", "info"]),
    message=texts,
    where=wheres,
)
results = st.builds(
    Result,
    check=words,
    outcome=st.sampled_from(["passed", "failed", "warned", "not_applicable", "not_observable", "crashed"]),
    question=texts,
    measurements=st.lists(measurements, max_size=3).map(tuple),
    coverage=st.none() | st.builds(Coverage, seen=counts, of=counts, unit=texts),
    findings=st.lists(findings, max_size=3).map(tuple),
    reason=texts,
    traceback=texts,
)
diagnoses = st.builds(
    Diagnosis,
    id=words,
    cause=st.sampled_from(list(CAUSES)) | texts,
    stream=words,
    magnitude=numbers,
    unit=texts,
    standard_error=st.none() | st.floats(0.0),
    confidence=st.floats(0.0, 1.0),
    where=wheres,
    remedy=texts,
    explains=st.lists(words, max_size=3).map(tuple),
)
files = st.builds(
    FileRecord,
    path=texts,
    size=counts,
    sha256=texts,
    digest_kind=st.sampled_from(["full", "partial"]),
    dialect=texts,
    inferred=st.dictionaries(texts, scalars, max_size=2),
    statistics=st.dictionaries(
        st.sampled_from(["sequence", "motion", "flow/10hz", "depth", "rgb"]) | texts,
        st.dictionaries(st.sampled_from(["duration_s", "mean_px", "distance_m"]) | texts, scalars, max_size=3),
        max_size=3,
    ),
    verdict=st.sampled_from(["clean", "findings", "incomplete"]),
    results=st.lists(results, max_size=3).map(tuple),
    diagnoses=st.lists(diagnoses, max_size=2).map(tuple),
    evidence=st.dictionaries(texts, texts, max_size=2),
)
