"""The smallest file that shows a finding: cut out of a sequence around its place, and checked again.

Read in this order: ``extract`` (tries pieces from short to long), ``place`` (where a finding lies, and the pieces
around it), ``rows`` (which rows of each stream a piece holds), ``cut`` (writes them), ``hdf5_copy`` (copies data).
"""
