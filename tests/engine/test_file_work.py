"""What the process of the command has of a survey loads nothing that measures."""

import pickle
import subprocess
import sys
from pathlib import Path

from fedora_qa.engine.file_work import PackedSurvey
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.survey import Survey, survey_of
from tests.support.handmade import write_handmade
from tests.support.killers import Counts


def test_windows_are_dealt_out_without_what_measures(tmp_path: Path) -> None:
    """A process that receives a packed survey has its windows without NumPy, until it opens the survey."""
    survey = survey_of(write_handmade(tmp_path / "seq.h5"), (Counts(),), CheckOptions(evidence=None), quiet)
    assert isinstance(survey, Survey)
    packed = PackedSurvey.of(survey)
    assert packed.load().token == survey.token
    path = tmp_path / "packed"
    path.write_bytes(pickle.dumps(packed))
    code = (
        "import pathlib, pickle, sys\n"
        f"packed = pickle.loads(pathlib.Path({str(path)!r}).read_bytes())\n"
        "print(len(packed.windows), 'numpy' in sys.modules, packed.load() and 'numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(len(survey.windows)), "False", "True"]
