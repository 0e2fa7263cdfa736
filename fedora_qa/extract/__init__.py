"""The smallest file that shows a finding: cut out of a sequence around its place, and checked again.

Read in this order: ``extract`` (tries pieces from short to long, and writes them), ``place`` (where a finding lies, the
pieces around it, and their rows), ``hdf5_copy`` (copies data).
"""
