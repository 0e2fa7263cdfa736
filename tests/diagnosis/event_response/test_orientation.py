"""Hypotheses for events that agree with the frames in another orientation."""

from fedora_qa.checks.event_response.orientation import EventSymmetry
from fedora_qa.diagnosis.event_response.orientation import hypotheses_of_symmetry
from fedora_qa.estimators.events.orientation import SYMMETRIES


def test_mirrored_frames_are_hypotheses_beside_mirrored_events() -> None:
    """Against frames alone one cannot tell which of the two is mirrored; exchanged axes only events can have."""
    for rival in range(2 * len(SYMMETRIES) - 1):
        symmetry = EventSymmetry.numbered(rival)
        words, causes = symmetry.text, {(each.cause, each.stream) for each in hypotheses_of_symmetry(symmetry)}
        assert (("mirrored", "rgb") in causes) == ("mirrored" in words and "axes" not in words)
        assert (("mirrored", "events") in causes) == ("mirrored" in words)
