"""``fedora-qa power``: which faults the checks detect, measured over a corpus with a manifest."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from fedora_qa.cli.console import print_table, text
from fedora_qa.cli.documents import write_document
from fedora_qa.cli.exit_codes import CLEAN, INCOMPLETE
from fedora_qa.cli.outputs import Outputs, require_renderer, require_result_folder
from fedora_qa.cli.progress import progress_bar
from fedora_qa.cli.settings import check_options, settings_from, with_jobs
from fedora_qa.power.detection_power import detection_power_of, write_confidence, write_detection_power
from fedora_qa.power.manifest import MANIFEST, read_manifest, require_files, require_other_names
from fedora_qa.power.study import State, Trial, measured_with, run_study, state_folder
from fedora_qa.power.tables import Origin, power_of
from fedora_qa.record.atomic import write_text
from fedora_qa.record.power_study import POWER, headline, power_to_markdown, tables_of


def run_power(
    corpora: tuple[Path, ...],
    config: Path | None,
    jobs: int | None,
    state: Path | None,
    outputs: Outputs,
    svg_path: Path | None,
    publish: Path | None,
    publish_confidence: Path | None,
    **overrides: Any,
) -> int:
    """Run the command and return its exit code."""
    # Detection is measured: whether a size matters is asked of the tables, not of the study.
    settings = replace(settings_from(config, {**overrides, "jobs": jobs}), profile="strict")
    # A study counts outcomes; evidence of thousands of files would only cost time and space.
    options = replace(check_options(settings), evidence=None)
    manifests = {corpus: read_manifest(corpus) for corpus in corpora}
    require_other_names(manifests)
    outputs = replace(outputs, own=(svg_path, publish, publish_confidence))
    outputs.require_writable([corpus / MANIFEST for corpus in corpora])
    if svg_path:
        require_renderer()
    # All files of all corpora are looked for before the first is measured: a study may run for hours.
    for corpus, manifest in manifests.items():
        require_files(corpus, manifest)
    settings = with_jobs(settings, [corpus / each.file for corpus in corpora for each in manifests[corpus].items])
    jobs = settings.jobs or 1
    # Each process checks whole files, with an equal share of the memory.
    options = replace(options, memory_bytes=settings.memory_bytes // jobs)
    started = datetime.now(UTC).isoformat(timespec="seconds")
    trials: list[Trial] = []
    for corpus, manifest in manifests.items():
        # The folder must exist and be writable before hours of measuring.
        folder = state_folder(corpus, state)
        require_result_folder(folder, "use --state")
        kept = State(folder, corpus, measured_with(settings.digest))
        with progress_bar(corpus.name) as report:
            trials += run_study(manifest, kept, options, jobs, report)
    measured_power = power_of(trials, Origin(", ".join(corpus.resolve().name for corpus in corpora), started, settings))
    if outputs.json:
        write_document(outputs.json, POWER.to_json(measured_power))
    if publish:
        write_detection_power(detection_power_of(measured_power), publish)
    if publish_confidence:
        write_confidence(measured_power, publish_confidence)
    if outputs.markdown:
        # A relative link works only where the drawing lies beside the page.
        folder_of_page = outputs.markdown.parent.resolve()
        drawing = svg_path.name if svg_path and svg_path.parent.resolve() == folder_of_page else ""
        write_document(outputs.markdown, power_to_markdown(measured_power, drawing))
    if outputs.html:
        from fedora_reports.power import render_power  # noqa: PLC0415 - an extra

        write_document(outputs.html, render_power(measured_power))
    if svg_path:
        from fedora_reports.power import draw_power  # noqa: PLC0415 - an extra

        write_text(svg_path, draw_power(measured_power))
    console = outputs.console()
    console.print(text(headline(measured_power), "bold"))
    if measured_power.crashed:
        paths = ", ".join(measured_power.crashed[:3])
        console.print(text(f"A check crashed in {len(measured_power.crashed)} files: {paths}", "bold magenta"))
    console.print()
    for table in tables_of(measured_power):
        print_table(console, table)
    return INCOMPLETE if measured_power.crashed else CLEAN
