"""Draft a dialect for an unknown file: a TOML text to be read, corrected and then used."""

import h5py
import hdf5plugin  # noqa: F401  the import registers the Blosc codec with HDF5

from fedora_qa.layout.draft_cameras import image_sizes, lines_to_fill_in
from fedora_qa.layout.draft_lines import camera_lines, draft_lines, in_order, quoted
from fedora_qa.layout.guesses import guess_places
from fedora_qa.layout.inventory import take_inventory

# One hint suffices to prefer a dialect; the second covers a file that lacks the first dataset.
_MOST_HINTS = 2


def draft_dialect(file: h5py.File, name: str) -> str:
    """Return the text of a dialect with every guess and its reason, and what nothing was guessed for.

    Parameters
    ----------
    file
        Open for reading. Only the first rows of each dataset are read.
    """
    items = take_inventory(file)
    guesses = {guess.key: guess for guess in guess_places(items)}
    ordered = in_order(guesses)
    lines = [
        "# A draft, guessed from names, shapes, types and first values. Verify every line before you use it:",
        "# a wrong unit here is a finding about the draft, not about the file.",
        f"name = {quoted(name)}",
        'description = "drafted"',
        "",
    ]
    # A path equal to the canonical key does not distinguish this dialect from the canonical one.
    paths = list(dict.fromkeys(str(guess.fields["path"]) for guess in ordered if guess.fields["path"] != guess.key))
    for path in paths[:_MOST_HINTS]:
        lines += ["[[hints]]", f"path = {quoted(path)}", ""]
    lines += draft_lines(ordered, items)
    cameras = camera_lines(item for item in items if item.form == "hdf5")
    declared = [*cameras, *lines_to_fill_in(image_sizes(items, guesses), guesses, cameras)]
    lines += ["", "[metadata]", *declared] if declared else []
    return "\n".join(lines).rstrip() + "\n"
