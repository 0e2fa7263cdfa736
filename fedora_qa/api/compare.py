"""Compare sequences, datasets, or versions of a release from Python."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from fedora_qa.api.options import AnyPath, copied_as, folder_texts, path_text, require_choice
from fedora_qa.cli.commands import COMPARISON_FALSE_ALARM_RATE
from fedora_qa.cli.compare import read_sources, sources_of
from fedora_qa.cli.outputs import page_or_none
from fedora_qa.cli.stats import reading_of
from fedora_qa.comparison.compare import compare as compare_subjects
from fedora_qa.comparison.paper_tables import paper_tables
from fedora_qa.comparison.tables import conclusions_of, false_alarm_sentence, headline, pair_tables
from fedora_qa.comparison.types import COMPARISON, Comparison, Design
from fedora_qa.errors import MisuseError
from fedora_qa.layout.dialect import split_choice
from fedora_qa.record.atomic import write_text
from fedora_qa.record.notebook import html_table, html_text, isolated_frame
from fedora_qa.record.tables import TextTable


@dataclass(frozen=True, slots=True, repr=False)
class ComparedSubjects(Comparison):
    """The document of a comparison; its first subject is the reference."""

    @property
    def tables(self) -> tuple[TextTable, ...]:
        """The tables of the paper, and those of each subject against the reference, as the command prints them."""
        return (*paper_tables(self), *(table for pair in pair_tables(self) for table in pair.tables))

    @property
    def conclusions(self) -> tuple[str, ...]:
        """What is concluded of each subject against the reference, a sentence each."""
        return conclusions_of(self)

    def save(self, path: AnyPath) -> None:
        """Write the comparison as JSON, as ``fedora-qa compare --json`` does."""
        write_text(Path(path), COMPARISON.to_json(self))

    def __repr__(self) -> str:
        names = " · ".join(subject.name for subject in self.subjects)
        return "\n".join([f"{names}: {headline(self)}", *self.conclusions])

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook: the report where its package is installed, else the tables."""
        page = page_or_none(self, {})
        return self.light_page() if page is None else isolated_frame(page)

    def light_page(self) -> str:
        """Return the conclusions and the tables as HTML without charts."""
        parts = [f"<p><b>{html_text(headline(self))}</b> {html_text(false_alarm_sentence(self))}</p>"]
        parts += [f"<p>{html_text(sentence)}</p>" for sentence in (*self.conclusions, *self.notes)]
        for pair in pair_tables(self):
            parts.append(f"<h4>{html_text(pair.title)}</h4><p>{html_text(pair.summary)}</p>")
            parts += [html_table(table.head, table.rows, table.title) for table in pair.tables]
        return "".join(parts)


def compare(
    *paths: AnyPath,
    design: Design | None = None,
    false_alarm_rate: float = COMPARISON_FALSE_ALARM_RATE,
    dialect: AnyPath | None = None,
    metadata: AnyPath | None = None,
    memory: str = "1GB",
    allow_external: Sequence[AnyPath] = (),
    apart: bool = False,
) -> ComparedSubjects:
    """Compare the second path and all others with the first, as ``fedora-qa compare`` does.

    Parameters
    ----------
    paths
        Two or more: sequences, folders of them, or records that ``save`` or ``fedora-qa check --json`` wrote. Files
        are measured; records are read, with the arrays beside them, and their findings compared.
    design
        What they are to each other: ``"versions"``, ``"sequences"`` or ``"datasets"``; None: versions where files have
        the same names, else sequences or datasets.
    false_alarm_rate
        Probability, between 0 and 1, that the comparison reports any difference where there is none.
    dialect, metadata, memory, allow_external, apart
        How the files are read, as for ``stats``.

    Returns
    -------
    ComparedSubjects
        Differences of distributions, in the units that stand beside them, with standard errors; and of two versions
        what changed of each file.

    Raises
    ------
    MisuseError
        Fewer than two paths, one that is missing or given twice, no HDF5 and no record, or an illegal option.
    FedoraError
        A file cannot be opened, or no dialect describes it.
    """
    if not 0 < false_alarm_rate < 1:
        raise MisuseError(
            f"Expected a false-alarm rate between 0 and 1, got {false_alarm_rate}; pass 0.01, for example"
        )
    require_choice("design", design, get_args(Design))
    external = folder_texts(allow_external) or ()
    reading = reading_of(path_text(dialect), path_text(metadata), memory, external, in_process=not apart)
    sources = sources_of([Path(path) for path in paths], split_choice(reading.dialect)[0])
    comparison = compare_subjects(read_sources(sources, reading), design, false_alarm_rate)
    return copied_as(ComparedSubjects, comparison)
