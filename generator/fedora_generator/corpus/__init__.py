"""A corpus: clean sequences, faulty copies of known size, and a manifest that says which is which.

``ladders`` knows the sizes, ``plan`` which files there are to be, ``build`` makes them, ``manifest`` lists them.
"""

from fedora_generator.corpus.build import build_corpus
from fedora_generator.corpus.plan import CorpusOptions, PlannedFault, PlannedFile, plan_corpus

__all__ = ["CorpusOptions", "PlannedFault", "PlannedFile", "build_corpus", "plan_corpus"]
