"""What it costs to gate many small sequences on a cluster: ``make bench-cluster``, printed for docs/cluster.md."""
