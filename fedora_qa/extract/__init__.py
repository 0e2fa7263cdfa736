"""The least file that shows a finding: cut out of a sequence around its place, and checked again."""
