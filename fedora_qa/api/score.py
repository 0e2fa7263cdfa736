"""Score predictions against a sequence from Python."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from fedora_qa.api.options import AnyPath, copied_as, folder_texts, path_text, require_choice
from fedora_qa.cli.outputs import page_or_none
from fedora_qa.cli.score import require_readable, scored_isolated
from fedora_qa.cli.settings import external_folders
from fedora_qa.layout.dialect import load_choice
from fedora_qa.record.atomic import write_text
from fedora_qa.record.notebook import html_table, html_text, isolated_frame
from fedora_qa.record.tables import TextTable
from fedora_qa.scoring.predictions import PredictionsForm
from fedora_qa.scoring.tables import headline, score_tables
from fedora_qa.scoring.types import SCORE, Score


@dataclass(frozen=True, slots=True, repr=False)
class ScoredPredictions(Score):
    """The document of a score: ``flow`` by rate, ``depth`` and ``pose``, what was predicted of them."""

    @property
    def tables(self) -> tuple[TextTable, ...]:
        """The tables that the command prints."""
        return score_tables(self)

    def save(self, path: AnyPath) -> None:
        """Write the score as JSON, as ``fedora-qa score --json`` does."""
        write_text(Path(path), SCORE.to_json(self))

    def __repr__(self) -> str:
        return f"{self.predictions} against {self.sequence}: {headline(self)}"

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook: the page where its package is installed, else the tables."""
        page = page_or_none(self, {})
        return self.light_page() if page is None else isolated_frame(page)

    def light_page(self) -> str:
        """Return the tables as HTML without charts."""
        parts = [f"<p><b>{html_text(headline(self))}</b></p>", *(f"<p>{html_text(note)}</p>" for note in self.notes)]
        parts += [html_table(table.head, table.rows, table.title) for table in self.tables]
        return "".join(parts)


def score(
    predictions: AnyPath,
    sequence: AnyPath,
    *,
    form: PredictionsForm | None = None,
    dialect: AnyPath | None = None,
    metadata: AnyPath | None = None,
    allow_external: Sequence[AnyPath] = (),
    apart: bool = False,
) -> ScoredPredictions:
    """Score predictions of flow, depth and pose against the truth of a sequence, as ``fedora-qa score`` does.

    Parameters
    ----------
    predictions
        An HDF5 file in canonical keys, with the timestamps of the sequence; NaN is a missing prediction. Or a folder of
        PNG images with flow, as DSEC has it.
    sequence
        An HDF5 file, or a folder that is one sequence.
    form
        What the predictions are: ``"canonical"`` or ``"dsec"``; None: as they are recognised.
    dialect
        How the sequence names and scales its data: a name, or a TOML file; None: as it is recognised.
    metadata
        A TOML file whose table ``[metadata]`` declares what the sequence does not declare.
    allow_external
        Folders with other files that the sequence may link to, or consist of.
    apart
        Whether to open each file in another process, as for ``check``.

    Returns
    -------
    ScoredPredictions
        Errors in the units at the ends of their names, over the values whose truth is valid and which are predicted,
        and the share of these, ``coverage``.

    Raises
    ------
    MisuseError
        A path that is missing or not HDF5, predictions that cannot be read or do not fit, or an illegal option.
    FedoraError
        The sequence cannot be opened or decoded, or no dialect describes it.
    """
    require_choice("form", form, get_args(PredictionsForm))
    paths = Path(predictions), Path(sequence)
    choice = load_choice(path_text(dialect), path_text(metadata))
    folders = external_folders(folder_texts(allow_external) or ())
    require_readable(*paths)
    result = scored_isolated(*paths, form, choice, folders, in_process=not apart)
    return copied_as(ScoredPredictions, result)
