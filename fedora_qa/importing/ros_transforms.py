"""Poses of a body among the transforms that ``tf`` publishes.

Sources: the definition of ``tf2_msgs``; REP 105 (each frame has one parent, and the body is ``base_link``).
"""

from typing import Any, Final

from fedora_qa.errors import MisuseError

BODY: Final = "base_link"
"""Frame of the body, where a map of topics names no other."""

TRANSFORMS: Final = frozenset({"tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"})
"""Types of messages with several transforms."""


class BodyTransforms:
    """The transforms of the body among those of a topic of ``tf``.

    Parameters
    ----------
    body
        Frame of the body; "": ``BODY``.
    """

    def __init__(self, body: str) -> None:
        self._body = body or BODY
        self._parents: dict[str, str] = {}

    def of(self, message: Any, topic: str) -> Any | None:
        """Return the transform of the body in its parent, None where a message has none.

        Raises
        ------
        MisuseError
            The body has two parents: its poses are of two worlds.
        """
        for each in message.transforms:
            self._parents.setdefault(_child(each), str(each.header.frame_id))
        transform = next((each for each in message.transforms if _child(each) == self._body), None)
        if transform is not None and (parent := str(transform.header.frame_id)) != self._parents[self._body]:
            raise MisuseError(
                f"Expected one parent of {self._body} in {topic}, got {self._parents[self._body]} and {parent}; map "
                "another topic or frame with --topics FILE.toml"
            )
        return transform

    def unread(self, topic: str) -> tuple[str, ...]:
        """Return the sentence that the body has no transform; none where it has or nothing was read."""
        if not self._parents or self._body in self._parents:
            return ()
        frames = ", ".join(sorted(self._parents))
        return (
            f'{topic} has transforms of {frames}, and none of {self._body}; choose by pose = "{topic}:FRAME" in '
            "--topics FILE.toml",
        )


def _child(transform: Any) -> str:
    """Return the frame that a transform places; older packages write a slash before its name."""
    return str(transform.child_frame_id).lstrip("/")
