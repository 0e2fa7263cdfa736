"""What releases cost to check: ``make bench-releases`` writes docs/release-costs.md."""
