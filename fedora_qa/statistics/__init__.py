"""Statistics of a sequence: the paper's sequence and flow tables, and more; no verdicts.

In order of reading: ``collector`` collects them window by window, from sums over sampled pixels (``moments``) and from
smoothed poses (``trajectory``).
"""
