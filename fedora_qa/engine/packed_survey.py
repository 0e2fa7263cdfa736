"""A survey as the process of the command has it: to read one loads what measures."""

import pickle
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fedora_qa.storage.place import Place

if TYPE_CHECKING:  # loads what measures
    from fedora_qa.engine.survey import Survey


@dataclass(frozen=True, slots=True)
class PackedSurvey:
    """A survey of a file, pickled, and what deals out its windows.

    Attributes
    ----------
    path
        The file.
    windows
        The windows that are to be measured, as of ``Survey``.
    pickled
        The survey.
    """

    path: Place
    windows: tuple[int, ...]
    pickled: bytes

    @staticmethod
    def of(survey: "Survey") -> "PackedSurvey":
        """Pack a survey."""
        return PackedSurvey(survey.path, survey.windows, pickle.dumps(survey, pickle.HIGHEST_PROTOCOL))

    def load(self) -> "Survey":
        """Return the survey. This takes the process of the command more than a second, and workers nothing."""
        survey: Survey = pickle.loads(self.pickled)
        return survey
