"""A corpus: clean sequences, faulty copies of known size, and a manifest that lists them.

Read ``plan`` (which files a corpus holds), with ``ladders`` (the sizes of faults); then ``build`` (how they are made)
and ``manifest`` (how they are listed). ``cli`` is the command.
"""

from fedora_generator.corpus.build import build_corpus
from fedora_generator.corpus.plan import CorpusOptions, PlannedFault, PlannedFile, plan_corpus

__all__ = ["CorpusOptions", "PlannedFault", "PlannedFile", "build_corpus", "plan_corpus"]
